/* Inverse kinematics of one arm, pose by pose, after structures.c: the compiled form of what
 * InverseKinematics does. */

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
