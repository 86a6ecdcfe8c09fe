/* Forward kinematics: poses of frames that hang on a tree of moving joints. */
#include <math.h>

/* Rotation by rows, then position. */
typedef double pose[12];

typedef struct {
    int joints;
    const int *parent;       /* an earlier joint; -1: the root */
    const int *column;       /* of a joint's value in a configuration */
    const double *placement; /* pose of each joint in its parent, at value zero */
    const double *sine;      /* 9: what the sine of the value adds to the rotation */
    const double *versine;   /* 9: what one minus its cosine adds */
    const double *slide;     /* 3: what the value adds to the position */
    int frames;
    const int *carrier;  /* the joint that a frame hangs on; -1: the root */
    const double *frame; /* its pose there */
} tree;

static void compose(const double *above, const double *local, double *out)
{
    for (int r = 0; r < 3; r++) {
        const double *row = above + 3 * r;
        for (int c = 0; c < 3; c++)
            out[3 * r + c] = row[0] * local[c] + row[1] * local[3 + c] + row[2] * local[6 + c];
        out[9 + r] = row[0] * local[9] + row[1] * local[10] + row[2] * local[11] + above[9 + r];
    }
}

static void move(const tree *t, int j, double value, double *local)
{
    const double *placement = t->placement + 12 * j;
    double sine = sin(value), versine = 1.0 - cos(value);
    for (int e = 0; e < 9; e++)
        local[e] = placement[e] + t->sine[9 * j + e] * sine + t->versine[9 * j + e] * versine;
    for (int r = 0; r < 3; r++)
        local[9 + r] = placement[9 + r] + t->slide[3 * j + r] * value;
}

/* Unit quaternion x y z w, by the largest of the trace and the diagonal (Shepperd, 1978). */
static void quaternion(const double *m, double *q)
{
    double trace = m[0] + m[4] + m[8];
    if (trace > 0) {
        double root = sqrt(trace + 1.0), factor = 0.5 / root;
        q[3] = 0.5 * root;
        q[0] = (m[7] - m[5]) * factor;
        q[1] = (m[2] - m[6]) * factor;
        q[2] = (m[3] - m[1]) * factor;
        return;
    }
    int i = m[4] > m[0] ? 1 : 0;
    if (m[8] > m[4 * i])
        i = 2;
    int j = (i + 1) % 3, k = (j + 1) % 3;
    double root = sqrt(m[4 * i] - m[4 * j] - m[4 * k] + 1.0), factor = 0.5 / root;
    q[i] = 0.5 * root;
    q[3] = (m[3 * k + j] - m[3 * j + k]) * factor;
    q[j] = (m[3 * j + i] + m[3 * i + j]) * factor;
    q[k] = (m[3 * k + i] + m[3 * i + k]) * factor;
}

/* Configurations (count, joints) to positions and quaternions (count, frames, 7). */
void frame_poses(const tree *t, int count, const double *q, double *out)
{
    pose joints[t->joints], local;
    for (int n = 0; n < count; n++, q += t->joints) {
        for (int j = 0; j < t->joints; j++) {
            int root = t->parent[j] < 0;
            move(t, j, q[t->column[j]], root ? joints[j] : local);
            if (!root)
                compose(joints[t->parent[j]], local, joints[j]);
        }
        for (int f = 0; f < t->frames; f++, out += 7) {
            const double *placed = t->frame + 12 * f;
            if (t->carrier[f] >= 0) {
                compose(joints[t->carrier[f]], placed, local);
                placed = local;
            }
            for (int r = 0; r < 3; r++)
                out[r] = placed[9 + r];
            quaternion(placed, out + 3);
        }
    }
}
