/* Inverse kinematics in closed form over grids: costs and joints for starts. The translation unit
 * starts with what compiler.py generates, which defines FORMS (the table), FORM_INPUTS and WORK.
 */
#include <math.h>
#include <string.h>

static const function form_table[] = {FORMS};

/* Arguments of a closed form: every pose with every pitch, end and candidate; see `Grid` in
 * program/inverse.py. */
typedef struct {
    int poses, pitches, ends, candidates;
    const double *candidate, *grasp, *pose, *pitch, *end;
} grid;

/* Joints and cost (out) of a candidate, all of whose arguments but those of the end are there. */
static void evaluate(int form, const grid *g, int end, double *x, double *out)
{
    double work[WORK];
    x[11] = g->end[2 * end + 1];
    x[15] = g->end[2 * end];
    const double *arguments[] = {x};
    double *results[] = {out};
    form_table[form](arguments, results, NULL, work, 0);
}

static void fill(const grid *g, int cell, int candidate, double *x)
{
    memcpy(x, g->candidate + FORM_INPUTS * candidate, sizeof(double) * FORM_INPUTS);
    memcpy(x, g->pose + 4 * (cell / g->pitches), sizeof(double) * 4);
    x[4] = g->pitch[cell % g->pitches];
    memcpy(x + 5, g->grasp, sizeof(double) * 2);
    memcpy(x + 12, g->grasp + 2, sizeof(double) * 3);
}

/* Joints (ends, outputs - 1) of the candidate of least cost of all ends together, the first pose and
 * pitch, where each costs something extra (candidates). No cost is negative, so that a candidate
 * whose first ends cost too much need not be followed further. */
void coarse_hold(int form, int outputs, const grid *g, const double *extra, double *joints)
{
    double x[FORM_INPUTS], out[outputs], found[g->ends * (outputs - 1)], least = HUGE_VAL;
    for (int c = 0; c < g->candidates; c++) {
        double sum = 0;
        fill(g, 0, c, x);
        for (int e = 0; e < g->ends && sum < least; e++) {
            evaluate(form, g, e, x, out);
            memcpy(found + e * (outputs - 1), out, sizeof(double) * (outputs - 1));
            sum += out[outputs - 1];
        }
        if (sum + extra[c] < least) {
            least = sum + extra[c];
            memcpy(joints, found, sizeof found);
        }
    }
}

/* The least costs (poses, pitches), without anything extra. */
void coarse_least_costs(int form, int outputs, const grid *g, const double *none, double *costs)
{
    double x[FORM_INPUTS], out[outputs];
    int best = 0; /* of the last cell: tried first, it is likely to be good here, too */
    for (int cell = 0; cell < g->poses * g->pitches; cell++) {
        costs[cell] = HUGE_VAL;
        for (int tried = 0, first = best; tried < g->candidates; tried++) {
            int c = (first + tried) % g->candidates;
            double sum = 0;
            fill(g, cell, c, x);
            for (int e = 0; e < g->ends && sum < costs[cell]; e++) {
                evaluate(form, g, e, x, out);
                sum += out[outputs - 1];
            }
            if (sum < costs[cell])
                costs[cell] = sum, best = c;
        }
    }
}
