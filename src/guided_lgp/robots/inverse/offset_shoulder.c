/* The compiled form of offset_shoulder.py: same names, same formulas, same order of solutions. */
#include <math.h>
#include <string.h>

#define TURN 6.283185307179586
#define HALF_TURN 3.141592653589793
#define BEYOND 0.1 /* rad outside the limits: where the wrist is not worth its formulas */

typedef struct {
    double lift, upper, fore, hand;
    double shoulder[3];  /* in the robot's root */
    double signs[7];     /* of joint values; the first one mirrors y */
    double limits[7][2]; /* the left arm's, a little inside */
} shoulder_arm;

static double clipped(double value, double low, double high)
{
    return value < low ? low : value > high ? high : value;
}

/* The wrist's joints, from the rotation that is left for it: R_36 = (R_z R_y R_x R_y)^T R. */
static void wrist(const double rot[3][3], double sin1, double cos1, double cos4, double sin4,
                  double *q)
{
    double sin2 = sin(q[1]), cos2 = cos(q[1]), sin3 = sin(q[2]), cos3 = cos(q[2]);
    double t2[3], u1[3], u3[3];
    for (int i = 0; i < 3; i++) {
        double r1 = cos1 * rot[0][i] + sin1 * rot[1][i], r2 = cos1 * rot[1][i] - sin1 * rot[0][i];
        double r3 = rot[2][i];
        double s1 = cos2 * r1 - sin2 * r3, s3 = sin2 * r1 + cos2 * r3;
        double t3 = cos3 * s3 - sin3 * r2;
        t2[i] = cos3 * r2 + sin3 * s3;
        u1[i] = cos4 * s1 - sin4 * t3;
        u3[i] = sin4 * s1 + cos4 * t3;
    }
    q[4] = atan2(-t2[0], u3[0]);
    q[5] = -acos(clipped(u1[0], -1.0, 1.0));
    q[6] = atan2(-u1[1], -u1[2]);
}

/* Lift and roll shifted into the limits where they are wider than half a turn. */
static void shift(const shoulder_arm *arm, double *q)
{
    if (q[2] < arm->limits[2][0]) q[2] += TURN;
    if (q[2] > arm->limits[2][1]) q[2] -= TURN;
    double turned = fmod(q[1] + HALF_TURN, TURN);
    q[1] = (turned < 0 ? turned + TURN : turned) - HALF_TURN;
}

/* Whether some joints are within their limits, widened by so much. */
static int inside(const shoulder_arm *arm, const double *q, int first, int end, double wider)
{
    int all = 1;
    for (int i = first; i < end; i++)
        all &= q[i] > arm->limits[i][0] - wider && q[i] < arm->limits[i][1] + wider;
    return all;
}

/* Both sides of the elbow (2, 7) for one pose; zeros where the wrist is out of reach, and for the
 * wrist's joints where the others are far outside their limits. */
static void solve(const shoulder_arm *arm, const double *rotation, const double *position,
                  double redundancy, double *q, unsigned char *valid)
{
    double mirror[3] = {1.0, arm->signs[0], 1.0}, rot[3][3], w[3];
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) rot[r][c] = mirror[r] * rotation[3 * r + c] * mirror[c];
        w[r] = (position[r] - arm->shoulder[r]) * mirror[r] - arm->hand * rot[r][0];
    }
    double upper = arm->upper, fore = arm->fore, pan = redundancy * arm->signs[0];
    double sin1 = sin(pan), cos1 = cos(pan);
    double x = cos1 * w[0] + sin1 * w[1] - arm->lift, y = cos1 * w[1] - sin1 * w[0], z = w[2];
    double cos4 = (x * x + y * y + z * z - upper * upper - fore * fore) / (2 * upper * fore);
    double sin4 = -sqrt(fmax(1.0 - cos4 * cos4, 1e-12));
    double along = upper + fore * cos4, across = -fore * sin4, sine = -y / across;
    memset(q, 0, 14 * sizeof(double));
    valid[0] = valid[1] = 0;
    if (!(fabs(cos4) < 1.0 && fabs(sine) < 1.0)) return;
    double roll = asin(sine), height = across * cos(roll), elbow = atan2(sin4, cos4);
    for (int side = 0; side < 2; side++, q += 7) {
        double h = side ? -height : height;
        q[0] = pan;
        q[1] = atan2(h * x - along * z, along * x + h * z);
        q[2] = side ? HALF_TURN - roll : roll;
        q[3] = elbow;
        shift(arm, q);
        if (inside(arm, q, 1, 3, BEYOND)) {
            wrist(rot, sin1, cos1, cos4, sin4, q);
            valid[side] = inside(arm, q, 0, 7, 0.0);
        }
        for (int i = 0; i < 7; i++) q[i] *= arm->signs[i];
    }
}

/* Values (count) of the redundant joint, so many for each of the poses (count / each, 9) and
 * (count / each, 3), to q (count, 2, 7) and valid (count, 2). */
void inverse(const shoulder_arm *arm, int count, int each, const double *rotation,
             const double *position, const double *redundancy, double *q, unsigned char *valid)
{
    for (int n = 0; n < count; n++) {
        int pose = n / each;
        solve(arm, rotation + 9 * pose, position + 3 * pose, redundancy[n], q + 14 * n,
              valid + 2 * n);
    }
}

/* frame times a rotation about one of its own axes. */
static void turn(double frame[3][3], int axis, double angle)
{
    int first = (axis + 1) % 3, second = (axis + 2) % 3;
    double c = cos(angle), s = sin(angle);
    for (int r = 0; r < 3; r++) {
        double a = frame[r][first], b = frame[r][second];
        frame[r][first] = c * a + s * b;
        frame[r][second] = c * b - s * a;
    }
}

/* Joints (count, 7) to rotations (count, 9) and origins (count, 3) of the tool frame. */
void forward(const shoulder_arm *arm, int count, const double *q, double *rotation,
             double *position)
{
    static const int axes[7] = {2, 1, 0, 1, 0, 1, 0};
    double mirror[3] = {1.0, arm->signs[0], 1.0};
    double ahead[7] = {arm->lift, 0, arm->upper, 0, arm->fore, 0, arm->hand};
    for (int n = 0; n < count; n++) {
        double frame[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, origin[3] = {0, 0, 0};
        for (int i = 0; i < 7; i++) {
            turn(frame, axes[i], q[7 * n + i] * arm->signs[i]);
            for (int r = 0; r < 3; r++) origin[r] += ahead[i] * frame[r][0];
        }
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++)
                rotation[9 * n + 3 * r + c] = mirror[r] * frame[r][c] * mirror[c];
            position[3 * n + r] = arm->shoulder[r] + origin[r] * mirror[r];
        }
    }
}
