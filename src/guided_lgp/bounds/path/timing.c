/* Natural cubic splines and their fastest timing, as in timing.py, which explains both. Points are
 * (count, joints) by rows.
 */
#include <math.h>
#include <stdlib.h>

/* Second derivatives of the natural spline through points at parameters s. */
void spline(int count, int joints, const double *s, const double *points, double *second)
{
    double *ratio = malloc(sizeof(double) * count);
    ratio[0] = 0;
    for (int k = 0; k < joints; k++)
        second[k] = second[(count - 1) * joints + k] = 0;
    for (int i = 1; i < count - 1; i++) {
        double before = s[i] - s[i - 1], after = s[i + 1] - s[i];
        double pivot = 2 * (before + after) - before * ratio[i - 1];
        ratio[i] = after / pivot;
        for (int k = 0; k < joints; k++) {
            const double *y = points + i * joints + k;
            double bend = 6 * ((y[joints] - y[0]) / after - (y[0] - y[-joints]) / before);
            second[i * joints + k] = (bend - before * second[(i - 1) * joints + k]) / pivot;
        }
    }
    for (int i = count - 2; i > 0; i--)
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

/* The limits of one interval: x may be at most `most`, and row k relates the x of both its ends. */
typedef struct {
    double most;
    double *width, *drift;
} interval;

static void keep(double *least, double value)
{
    if (value > 0 && value < *least)
        *least = value;
}

static void find_limits(int joints, double twice, const double *slopes, const double *bends,
                        const double *velocity, const double *acceleration, double still,
                        interval *limits)
{
    double most = HUGE_VAL, *width = limits->width, *drift = limits->drift;
    for (int k = 0; k < joints; k++) {
        double fastest = velocity[k] / fabs(slopes[k]);
        most = fastest * fastest < most ? fastest * fastest : most;
    }
    for (int k = 0; k < 2 * joints; k++) { /* those of a point hold at its neighbour, too */
        double a = k < joints ? slopes[k] : slopes[k] + twice * bends[k];
        double g = acceleration[k % joints];
        int moves = fabs(a) > still;
        width[k] = moves ? g / fabs(a) : HUGE_VAL;
        drift[k] = moves ? bends[k] / a : 0;
        if (!moves)
            keep(&most, g / fabs(bends[k]));
    }
    for (int k = 0; k < 2 * joints; k++) {
        for (int l = 0; l < 2 * joints; l++)
            keep(&most, (width[k] + width[l]) / (drift[k] - drift[l]));
        keep(&most, width[k] / (drift[k] - 1 / twice));
    }
    limits->most = most;
}

/* The largest squared path velocities x (count) from rest to rest. */
void fastest(int count, int joints, const double *grid, const double *slopes, const double *bends,
             const double *velocity, const double *acceleration, double still, double slowest,
             double *x)
{
    int rows = 2 * joints;
    double *memory = malloc(sizeof(double) * 2 * rows * count);
    interval *limits = malloc(sizeof(interval) * count);
    for (int i = 0; i < count - 1; i++) {
        limits[i].width = memory + 2 * rows * i;
        limits[i].drift = limits[i].width + rows;
        find_limits(joints, 2 * (grid[i + 1] - grid[i]), slopes + i * joints, bends + i * joints,
                    velocity, acceleration, still, &limits[i]);
    }
    x[0] = x[count - 1] = 0;
    for (int i = count - 2; i > 0; i--) {
        double twice = 2 * (grid[i + 1] - grid[i]);
        x[i] = limits[i].most;
        for (int k = 0; k < rows; k++) {
            double factor = 1 - twice * limits[i].drift[k];
            double reached = (x[i + 1] + twice * limits[i].width[k]) / factor;
            if (factor > 0 && reached < x[i])
                x[i] = reached;
        }
    }
    for (int i = 0; i < count - 2; i++) {
        double twice = 2 * (grid[i + 1] - grid[i]);
        for (int k = 0; k < rows; k++) {
            double reached = (1 - twice * limits[i].drift[k]) * x[i] + twice * limits[i].width[k];
            x[i + 1] = reached < x[i + 1] ? reached : x[i + 1];
        }
        x[i + 1] = x[i + 1] > slowest ? x[i + 1] : slowest;
    }
    free(memory);
    free(limits);
}
