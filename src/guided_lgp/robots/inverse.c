/* Inverse kinematics of one arm, pose by pose: the compiled form of subproblems.py, structures.py
 * and of what InverseKinematics does with them. Names and the order of branches are the same. */

#include <math.h>
#include <string.h>

#define MOST 7 /* joints */
#define TINY 1e-12

typedef double Vector[3];
typedef double Matrix[3][3];

typedef struct {
    int joints;
    int redundant; /* or -1 */
    int structure; /* bits as in structures.py, or -1: fixed starts */
    int branches;
    int iterations;
    double exact, capture, damping, longest;
    const double *axes, *points; /* joints x 3 */
    const double *tool;          /* rotation, row by row, and position */
    const double *starts;        /* branches x 6 */
} Arm;

enum { BACKWARDS = 1, REACH_PARALLEL = 2, REACH_BACKWARDS = 4, PARALLEL = 8 };

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

/* The point nearest to lines. */
static void meeting(Vector *w, Vector *p, int count, Vector out) {
    Matrix a = {{0}};
    Vector b = {0};
    for (int k = 0; k < count; k++)
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                double entry = (i == j) - w[k][i] * w[k][j];
                a[i][j] += entry;
                b[i] += entry * p[k][j];
            }
    Vector columns[3];
    cross(a[1], a[2], columns[0]);
    cross(a[2], a[0], columns[1]);
    cross(a[0], a[1], columns[2]);
    double determinant = dot(a[0], columns[0]);
    for (int i = 0; i < 3; i++)
        out[i] = (columns[0][i] * b[0] + columns[1][i] * b[1] + columns[2][i] * b[2]) / determinant;
}

static void reach_crossing(Vector *w, Vector *p, const Vector start, const Vector end,
                           double out[4][3]) {
    Vector centre, aim, arm, raised;
    double third[2], second[2];
    meeting(w, p, 2, centre);
    subtract(end, centre, aim);
    to_distance(w[2], p[2], start, centre, dot(aim, aim), third);
    for (int i = 0; i < 2; i++) {
        rotated(w[2], third[i], p[2], start, arm);
        subtract(arm, centre, arm);
        to_height(w[1], arm, w[0], dot(w[0], aim), second);
        for (int j = 0; j < 2; j++) {
            Matrix turned;
            turn(w[1], second[j], turned);
            apply(turned, arm, raised);
            double *q = out[2 * i + j];
            q[0] = onto(w[0], raised, aim), q[1] = second[j], q[2] = third[i];
        }
    }
}

static void reach_parallel(Vector *w, Vector *p, const Vector start, const Vector end,
                           double out[4][3]) {
    Vector aim, arm, raised, low, high;
    double third[2], second[2];
    subtract(start, p[2], low);
    subtract(end, p[2], high);
    to_height(w[2], low, w[0], dot(w[0], high), third);
    subtract(end, p[0], aim);
    for (int i = 0; i < 2; i++) {
        rotated(w[2], third[i], p[2], start, arm);
        to_distance(w[1], p[1], arm, p[0], dot(aim, aim), second);
        for (int j = 0; j < 2; j++) {
            rotated(w[1], second[j], p[1], arm, raised);
            subtract(raised, p[0], raised);
            double *q = out[2 * i + j];
            q[0] = onto(w[0], raised, aim), q[1] = second[j], q[2] = third[i];
        }
    }
}

static void reversed(Vector *w, Vector *p, int count, Vector *back, Vector *at) {
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            back[i][k] = -w[count - 1 - i][k];
            at[i][k] = p[count - 1 - i][k];
        }
}

static void swap_ends(double *q, int count) {
    for (int i = 0; i < count / 2; i++) {
        double first = q[i];
        q[i] = q[count - 1 - i];
        q[count - 1 - i] = first;
    }
}

static void reach(int structure, Vector *w, Vector *p, const Vector start, const Vector end,
                  double out[4][3]) {
    Vector back[3], at[3];
    int backwards = structure & REACH_BACKWARDS;
    if (backwards) reversed(w, p, 3, back, at), w = back, p = at;
    (structure & REACH_PARALLEL ? reach_parallel : reach_crossing)(
        w, p, backwards ? end : start, backwards ? start : end, out);
    if (backwards)
        for (int i = 0; i < 4; i++) swap_ends(out[i], 3);
}

static void guess_wrist(int structure, Vector *w, Vector *p, Matrix rotation, const Vector shift,
                        double out[8][6]) {
    Vector back[6], at[6], centre, target, moved;
    Matrix motion;
    int backwards = structure & BACKWARDS;
    memcpy(motion, rotation, sizeof(Matrix));
    copy(shift, moved);
    if (backwards) {
        reversed(w, p, 6, back, at), w = back, p = at;
        transposed(rotation, motion);
        apply(motion, shift, moved);
        for (int i = 0; i < 3; i++) moved[i] = -moved[i];
    }
    meeting(w + 3, p + 3, 3, centre);
    apply(motion, centre, target);
    add(target, moved, target);
    double first[4][3], last[2][3];
    reach(structure, w, p, centre, target, first);
    for (int i = 0; i < 4; i++) {
        Matrix rest, turned;
        memcpy(rest, motion, sizeof(Matrix));
        for (int joint = 0; joint < 3; joint++) {
            turn(w[joint], -first[i][joint], turned);
            multiply(turned, rest, rest);
        }
        wrist(w + 3, rest, last);
        for (int k = 0; k < 2; k++) {
            double *q = out[2 * i + k];
            memcpy(q, first[i], sizeof first[i]);
            memcpy(q + 3, last[k], sizeof last[k]);
            if (backwards) swap_ends(q, 6);
        }
    }
}

static void guess_parallel(Vector *w, Vector *p, Matrix rotation, const Vector shift,
                           double out[8][6]) {
    Vector centre, target, level, offset;
    double first[2], fifth[2], third[2];
    Vector back = {-w[0][0], -w[0][1], -w[0][2]}, down = {-w[4][0], -w[4][1], -w[4][2]};
    Matrix inverse;
    transposed(rotation, inverse);
    meeting(w + 4, p + 4, 2, centre);
    apply(rotation, centre, target);
    add(target, shift, target);
    subtract(target, p[0], offset);
    subtract(centre, p[0], level);
    to_height(back, offset, w[1], dot(w[1], level), first);
    for (int i = 0; i < 2; i++) {
        Matrix turned, planar;
        Vector normal;
        turn(w[0], first[i], turned);
        transposed(turned, planar);
        apply(turned, w[1], normal);
        apply(inverse, normal, normal);
        to_height(down, w[1], w[5], dot(w[5], normal), fifth);
        for (int j = 0; j < 2; j++) {
            Matrix unbent, unrolled;
            Vector seen, tip, direction, reached;
            turn(w[4], -fifth[j], unbent);
            apply(unbent, w[1], seen);
            double sixth = onto(w[5], normal, seen);
            turn(w[5], -sixth, unrolled);
            rotated(w[4], -fifth[j], p[4], p[3], tip);
            rotated(w[5], -sixth, p[5], tip, tip);
            apply(rotation, tip, tip);
            add(tip, shift, tip);
            subtract(tip, p[0], tip);
            apply(planar, tip, tip);
            add(tip, p[0], tip);
            apply(unbent, w[4], direction);
            apply(unrolled, direction, direction);
            apply(rotation, direction, direction);
            apply(planar, direction, direction);
            double total = onto(w[1], w[4], direction);
            subtract(tip, p[1], reached);
            to_distance(w[2], p[2], p[3], p[1], dot(reached, reached), third);
            for (int k = 0; k < 2; k++) {
                Vector folded;
                rotated(w[2], third[k], p[2], p[3], folded);
                subtract(folded, p[1], folded);
                double second = onto(w[1], folded, reached);
                double along3 = copysign(1.0, dot(w[1], w[2])), along4 = copysign(1.0, dot(w[1], w[3]));
                double *q = out[4 * i + 2 * j + k];
                q[0] = first[i], q[1] = second, q[2] = third[k];
                q[3] = along4 * (total - second - along3 * third[k]);
                q[4] = fifth[j], q[5] = sixth;
            }
        }
    }
}

/* The six free screws, and the motion that they have to make. */
static void six(const Arm *arm, Matrix rotation, const Vector position, double value, Vector *w,
                Vector *p, Matrix motion, Vector shift) {
    Matrix bend, tool;
    Vector origin;
    int r = arm->redundant, free = 0;
    const Vector *axes = (const Vector *)arm->axes, *points = (const Vector *)arm->points;
    memcpy(tool, arm->tool, sizeof(Matrix));
    copy(arm->tool + 9, origin);
    if (r >= 0) {
        turn(axes[r], value, bend);
        multiply(bend, tool, tool);
        rotated(axes[r], value, points[r], origin, origin);
    }
    for (int i = 0; i < arm->joints; i++) {
        if (i == r) continue;
        copy(axes[i], w[free]);
        copy(points[i], p[free]);
        if (r >= 0 && i > r) {
            apply(bend, axes[i], w[free]);
            rotated(axes[r], value, points[r], points[i], p[free]);
        }
        free++;
    }
    transposed(tool, motion);
    multiply(rotation, motion, motion);
    apply(motion, origin, shift);
    subtract(position, shift, shift);
}

static void forward(const Arm *arm, const double *q, Matrix rotation, Vector position) {
    const Vector *axes = (const Vector *)arm->axes, *points = (const Vector *)arm->points;
    memcpy(rotation, arm->tool, sizeof(Matrix));
    copy(arm->tool + 9, position);
    for (int i = arm->joints - 1; i >= 0; i--) {
        Matrix turned;
        turn(axes[i], q[i], turned);
        multiply(turned, rotation, rotation);
        subtract(position, points[i], position);
        apply(turned, position, position);
        add(points[i], position, position);
    }
}

/* What is missing from a pose to another; returns its length. */
static double difference(Matrix turned, const Vector origin, Matrix rotation, const Vector position,
                      double out[6]) {
    Matrix back, rest;
    transposed(turned, back);
    multiply(rotation, back, rest);
    Vector twist = {(rest[2][1] - rest[1][2]) / 2, (rest[0][2] - rest[2][0]) / 2,
                    (rest[1][0] - rest[0][1]) / 2};
    double sine = sqrt(dot(twist, twist)), square = 0;
    double angle = atan2(sine, (rest[0][0] + rest[1][1] + rest[2][2] - 1) / 2);
    double scale = sine > 1e-9 ? angle / sine : 1.0;
    for (int i = 0; i < 3; i++) out[i] = position[i] - origin[i], out[3 + i] = scale * twist[i];
    for (int i = 0; i < 6; i++) square += out[i] * out[i];
    return sqrt(square);
}

/* Columns of the six free joints. */
static void jacobian(const Arm *arm, const double *q, const Vector position, double out[6][6]) {
    const Vector *axes = (const Vector *)arm->axes, *points = (const Vector *)arm->points;
    Matrix frame = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, turned;
    Vector origin = {0}, axis, point, offset, column;
    int free = 0;
    for (int i = 0; i < arm->joints; i++) {
        apply(frame, axes[i], axis);
        apply(frame, points[i], point);
        add(origin, point, point);
        if (i != arm->redundant) {
            subtract(position, point, offset);
            cross(axis, offset, column);
            for (int k = 0; k < 3; k++) out[k][free] = column[k], out[3 + k][free] = axis[k];
            free++;
        }
        turn(axes[i], q[i], turned);
        multiply(frame, turned, frame);
        apply(frame, points[i], offset);
        subtract(point, offset, origin);
    }
}

/* Solve a (6, 6) x = b by elimination with pivots; b becomes x. */
static void solve(double a[6][6], double b[6]) {
    for (int k = 0; k < 6; k++) {
        int pivot = k;
        for (int i = k + 1; i < 6; i++)
            if (fabs(a[i][k]) > fabs(a[pivot][k])) pivot = i;
        for (int j = 0; j < 6; j++) {
            double entry = a[k][j];
            a[k][j] = a[pivot][j], a[pivot][j] = entry;
        }
        double entry = b[k];
        b[k] = b[pivot], b[pivot] = entry;
        for (int i = k + 1; i < 6; i++) {
            double factor = a[i][k] / a[k][k];
            for (int j = k; j < 6; j++) a[i][j] -= factor * a[k][j];
            b[i] -= factor * b[k];
        }
    }
    for (int i = 5; i >= 0; i--) {
        for (int j = i + 1; j < 6; j++) b[i] -= a[i][j] * b[j];
        b[i] /= a[i][i];
    }
}

static void step(const Arm *arm, double *q, const Vector position, const double error[6],
                 double size) {
    double columns[6][6], square[6][6], rest[6], change[6], longest = TINY;
    jacobian(arm, q, position, columns);
    for (int i = 0; i < 6; i++) {
        rest[i] = error[i];
        for (int j = 0; j < 6; j++) {
            square[i][j] = i == j ? arm->damping * size * size : 0.0;
            for (int k = 0; k < 6; k++) square[i][j] += columns[i][k] * columns[j][k];
        }
    }
    solve(square, rest);
    for (int k = 0; k < 6; k++) {
        change[k] = 0;
        for (int i = 0; i < 6; i++) change[k] += columns[i][k] * rest[i];
        longest = fmax(longest, fabs(change[k]));
    }
    double share = fmin(1.0, arm->longest / longest);
    for (int i = 0, k = 0; i < arm->joints; i++)
        if (i != arm->redundant) q[i] += share * change[k++];
}

/* Newton's method where q is near a solution; what is missing in the end. */
static double polish(const Arm *arm, double *q, Matrix rotation, const Vector position) {
    Matrix turned;
    Vector origin;
    double error[6], size = INFINITY;
    for (int i = 0; i <= arm->iterations; i++) {
        forward(arm, q, turned, origin);
        size = difference(turned, origin, rotation, position, error);
        if (!(size > arm->exact / 10) || i == arm->iterations) break;
        if (i == 0 && !(size < arm->capture)) break;
        step(arm, q, origin, error, size);
    }
    return size;
}

/* Solve for poses; see InverseKinematics.inverse. */
void inverse(const Arm *arm, int count, const double *rotations, const double *positions,
             const double *values, double *solutions, double *missing) {
    Vector w[6], p[6], shift;
    Matrix rotation, motion;
    double guesses[8][6];
    for (int n = 0; n < count; n++) {
        const double *position = positions + 3 * n;
        memcpy(rotation, rotations + 9 * n, sizeof(Matrix));
        if (arm->structure >= 0) {
            six(arm, rotation, position, values[n], w, p, motion, shift);
            if (arm->structure & PARALLEL)
                guess_parallel(w, p, motion, shift, guesses);
            else
                guess_wrist(arm->structure, w, p, motion, shift, guesses);
        }
        for (int branch = 0; branch < arm->branches; branch++) {
            double *q = solutions + (n * arm->branches + branch) * arm->joints;
            const double *guess = arm->structure >= 0 ? guesses[branch] : arm->starts + 6 * branch;
            for (int i = 0, k = 0; i < arm->joints; i++)
                q[i] = i == arm->redundant ? values[n] : guess[k++];
            missing[n * arm->branches + branch] = polish(arm, q, rotation, position);
        }
    }
}
