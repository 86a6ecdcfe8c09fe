/* Vectors, and the compiled form of subproblems.py: same names, same order of solutions. */

#include <math.h>
#include <string.h>

#define MOST 7 /* joints */
#define TINY 1e-12

typedef double Vector[3];
typedef double Matrix[3][3];

static double dot(const Vector a, const Vector b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const Vector a, const Vector b, Vector out) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static void subtract(const Vector a, const Vector b, Vector out) {
    for (int i = 0; i < 3; i++) out[i] = a[i] - b[i];
}

static void add(const Vector a, const Vector b, Vector out) {
    for (int i = 0; i < 3; i++) out[i] = a[i] + b[i];
}

static void copy(const Vector a, Vector out) { memcpy(out, a, sizeof(Vector)); }

static void apply(Matrix a, const Vector v, Vector out) {
    Vector r = {dot(a[0], v), dot(a[1], v), dot(a[2], v)};
    copy(r, out);
}

static void transposed(Matrix a, Matrix out) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) out[i][j] = a[j][i];
}

static void multiply(Matrix a, Matrix b, Matrix out) {
    Matrix r;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            r[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
    memcpy(out, r, sizeof(Matrix));
}

static void turn(const Vector w, double angle, Matrix out) {
    double s = sin(angle), c = cos(angle), r = 1.0 - c;
    out[0][0] = c + w[0] * w[0] * r;
    out[1][1] = c + w[1] * w[1] * r;
    out[2][2] = c + w[2] * w[2] * r;
    out[0][1] = w[0] * w[1] * r - w[2] * s, out[1][0] = w[0] * w[1] * r + w[2] * s;
    out[0][2] = w[0] * w[2] * r + w[1] * s, out[2][0] = w[0] * w[2] * r - w[1] * s;
    out[1][2] = w[1] * w[2] * r - w[0] * s, out[2][1] = w[1] * w[2] * r + w[0] * s;
}

static void rotated(const Vector w, double angle, const Vector at, const Vector v, Vector out) {
    Matrix turned;
    turn(w, angle, turned);
    subtract(v, at, out);
    apply(turned, out, out);
    add(at, out, out);
}

/* Both angles with a cos q + b sin q = c. */
static void linear(double a, double b, double c, double out[2]) {
    double middle = atan2(b, a), cosine = c / fmax(sqrt(a * a + b * b), TINY);
    double half = acos(fmin(fmax(cosine, -1.0), 1.0));
    out[0] = middle + half;
    out[1] = middle - half;
}

static double onto(const Vector axis, const Vector start, const Vector end) {
    Vector normal;
    cross(start, end, normal);
    return atan2(dot(axis, normal), dot(start, end) - dot(axis, start) * dot(axis, end));
}

static void to_distance(const Vector axis, const Vector at, const Vector v, const Vector centre,
                        double square, double out[2]) {
    Vector arm, offset, along, across, normal;
    subtract(v, at, arm);
    subtract(at, centre, offset);
    double height = dot(axis, arm);
    for (int i = 0; i < 3; i++) along[i] = height * axis[i];
    subtract(arm, along, across);
    cross(axis, arm, normal);
    double constant = dot(arm, arm) + dot(offset, offset) + 2 * dot(offset, along);
    linear(2 * dot(offset, across), 2 * dot(offset, normal), square - constant, out);
}

static void to_height(const Vector axis, const Vector v, const Vector normal, double height,
                      double out[2]) {
    Vector along, across, side;
    double part = dot(axis, v);
    for (int i = 0; i < 3; i++) along[i] = part * axis[i];
    subtract(v, along, across);
    cross(axis, v, side);
    linear(dot(normal, across), dot(normal, side), height - dot(normal, along), out);
}

static void across(const Vector axis, Vector out) {
    int smallest = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(axis[i]) < fabs(axis[smallest])) smallest = i;
    Vector unit = {smallest == 0, smallest == 1, smallest == 2};
    cross(axis, unit, out);
}

static void wrist(Vector *w, Matrix rotation, double out[2][3]) {
    Vector pointing, side, end;
    double middle[2];
    apply(rotation, w[2], pointing);
    to_height(w[1], w[2], w[0], dot(w[0], pointing), middle);
    across(w[2], side);
    for (int k = 0; k < 2; k++) {
        Matrix bent, first, rest;
        turn(w[1], middle[k], bent);
        apply(bent, w[2], end);
        out[k][0] = onto(w[0], end, pointing);
        out[k][1] = middle[k];
        turn(w[0], out[k][0], first);
        multiply(first, bent, first);
        transposed(first, rest);
        multiply(rest, rotation, rest);
        apply(rest, side, end);
        out[k][2] = onto(w[2], side, end);
    }
}
