/* The compiled form of poses.py, to the last bit the same. */

/* Poses first * second, (count, 7) each. */
void compose(int count, const double *first, const double *second, double *out)
{
    for (int n = 0; n < count; n++, first += 7, second += 7, out += 7) {
        double x = first[0], y = first[1], z = first[2];
        double a = first[3], b = first[4], c = first[5], s = first[6];
        double u = second[0], v = second[1], w = second[2];
        double d = second[3], e = second[4], f = second[5], t = second[6];
        double k = 2.0 * (b * w - c * v), m = 2.0 * (c * u - a * w), o = 2.0 * (a * v - b * u);
        out[0] = x + (u + s * k + (b * o - c * m));
        out[1] = y + (v + s * m + (c * k - a * o));
        out[2] = z + (w + s * o + (a * m - b * k));
        out[3] = s * d + t * a + (b * f - c * e);
        out[4] = s * e + t * b + (c * d - a * f);
        out[5] = s * f + t * c + (a * e - b * d);
        out[6] = s * t - (a * d + b * e + c * f);
    }
}
