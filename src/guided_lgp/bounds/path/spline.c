/* Cubic splines through points (count, joints) by rows, at ascending parameters. */
#include <stdlib.h>

/* Second derivatives of the spline through points at parameters s. At an end it has the slope that
 * is given (joints), or no second derivative where none is. */
void spline(int count, int joints, const double *s, const double *points, const double *out,
            const double *into, double *second)
{
    double *ratio = malloc(sizeof(double) * count);
    for (int i = 0; i < count; i++) {
        double before = i ? s[i] - s[i - 1] : 0, after = i < count - 1 ? s[i + 1] - s[i] : 0;
        int free_end = (!i && !out) || (i == count - 1 && !into);
        double below = free_end ? 0 : before, above = free_end ? 0 : after;
        double pivot = (free_end ? 1 : 2 * (before + after)) - (i ? below * ratio[i - 1] : 0);
        ratio[i] = above / pivot;
        for (int k = 0; k < joints; k++) {
            const double *y = points + i * joints + k;
            double arrives = i ? (y[0] - y[-joints]) / before : out ? out[k] : 0;
            double leaves = i < count - 1 ? (y[joints] - y[0]) / after : into ? into[k] : 0;
            double bend = free_end ? 0 : 6 * (leaves - arrives);
            second[i * joints + k] = bend / pivot;
            if (i)
                second[i * joints + k] -= below * second[(i - 1) * joints + k] / pivot;
        }
    }
    for (int i = count - 2; i >= 0; i--)
        for (int k = 0; k < joints; k++)
            second[i * joints + k] -= ratio[i] * second[(i + 1) * joints + k];
    free(ratio);
}

/* Values and the first two derivatives at ascending parameters; each may be null. */
void evaluate(int count, int joints, const double *s, const double *points, const double *second,
              int places, const double *at, double *value, double *slope, double *bend)
{
    int i = 0;
    for (int p = 0; p < places; p++) {
        while (i < count - 2 && at[p] >= s[i + 1])
            i++;
        double h = s[i + 1] - s[i], a = s[i + 1] - at[p], b = at[p] - s[i];
        for (int k = 0; k < joints; k++) {
            double m0 = second[i * joints + k], m1 = second[(i + 1) * joints + k];
            double y0 = points[i * joints + k] / h - m0 * h / 6;
            double y1 = points[(i + 1) * joints + k] / h - m1 * h / 6;
            int e = p * joints + k;
            if (value)
                value[e] = (m0 * a * a * a + m1 * b * b * b) / (6 * h) + y0 * a + y1 * b;
            if (slope)
                slope[e] = (m1 * b * b - m0 * a * a) / (2 * h) + y1 - y0;
            if (bend)
                bend[e] = (m0 * a + m1 * b) / h;
        }
    }
}
