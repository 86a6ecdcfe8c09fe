/* The fastest timing of a path, as in timing.py, which explains it. */
#include <math.h>
#include <stdlib.h>

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
