/* The compiled form of structures.py, after subproblems.c: same names, same order of branches. */

enum { BACKWARDS = 1, REACH_PARALLEL = 2, REACH_BACKWARDS = 4, PARALLEL = 8 };

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
