/* Augmented Lagrangian with Levenberg-Marquardt Gauss-Newton steps for a nonlinear program that is
 * a list of kernel instances. The translation unit starts with the generated kernels and defines
 * KERNELS (the table), FORMS (closed forms), FORM_INPUTS, LARGEST_INPUT, LARGEST_ROWS and WORK;
 * cholesky.c follows.
 * `Interpreter` in solver.py is the same algorithm on CasADi's virtual machine; keep the two alike.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef int (*function)(const double **, double **, int *, double *, int);

typedef struct {
    function residual, jacobian;
    int inputs, rows, equality;
} kernel_type;

static const kernel_type kernel_table[] = {KERNELS};
static const function form_table[] = {FORMS}; /* closed forms */

typedef struct {
    int variables, instances, rows, kept; /* variables that stay where they are, the first ones */
    const int *kernel, *input_start, *inputs;
    const double *levers; /* how much a row changes at most per unit of each input */
    const int *parameter_start, *row_start;
    const double *parameters;
    const double *weight, *target, *lower, *upper;
    const int *order; /* order[v]: place of variable v in the factorisation */
} program;

typedef struct {
    double penalty, growth, largest_penalty, damping, tolerance, slack;
    int steps, inner, patience;
} settings;

static void gather(const program *nlp, int i, const double *values, double *x)
{
    const int *inputs = nlp->inputs + nlp->input_start[i];
    for (int j = 0; j < kernel_table[nlp->kernel[i]].inputs; j++)
        x[j] = values[inputs[j]];
}

/* Rows that were evaluated last, where, and how far each instance was from having any effect then:
 * inequalities that are not active, nor have a multiplier, count for nothing. What cannot move is
 * still: it has been evaluated once for all. */
typedef struct {
    double *rows, *inputs, *spare;
    char *still;
} memory;

static void find_spare(const program *nlp, const double *multiplier, double penalty, int i,
                       memory *last)
{
    double least = kernel_table[nlp->kernel[i]].equality ? -1 : HUGE_VAL;
    for (int r = nlp->row_start[i]; r < nlp->row_start[i + 1]; r++) {
        double above = last->rows[r] - multiplier[r] / penalty;
        if (!(above >= least))
            least = above;
    }
    last->spare[i] = 0.999 * least; /* rounding must not make it more than it is */
}

/* Whether the inputs have not changed enough since for an instance to have an effect. */
static int is_idle(const program *nlp, int i, const double *x, const memory *last)
{
    if (!(last->spare[i] > 0))
        return 0;
    const double *levers = nlp->levers + nlp->input_start[i];
    const double *before = last->inputs + nlp->input_start[i];
    double way = 0;
    for (int j = 0; j < kernel_table[nlp->kernel[i]].inputs; j++)
        way += levers[j] * fabs(x[j] - before[j]);
    return way < last->spare[i];
}

/* All rows; those of idle instances are left at what they were, which has the same effect: none. */
static void residuals(const program *nlp, const double *values, const double *multiplier,
                      double penalty, memory *last, double *c)
{
    double x[LARGEST_INPUT], work[WORK];
    for (int i = 0; i < nlp->instances; i++) {
        if (last->still[i])
            continue;
        gather(nlp, i, values, x);
        if (is_idle(nlp, i, x, last))
            continue;
        const double *arguments[] = {x, nlp->parameters + nlp->parameter_start[i]};
        double *results[] = {last->rows + nlp->row_start[i]};
        kernel_table[nlp->kernel[i]].residual(arguments, results, NULL, work, 0);
        memcpy(last->inputs + nlp->input_start[i], x,
               sizeof(double) * kernel_table[nlp->kernel[i]].inputs);
        find_spare(nlp, multiplier, penalty, i, last);
    }
    memcpy(c, last->rows, sizeof(double) * nlp->rows);
}

/* Largest violation, where inequalities may be violated by `slack`. */
static double violation(const program *nlp, const double *c, double slack)
{
    double largest = 0;
    for (int i = 0; i < nlp->instances; i++) {
        int equality = kernel_table[nlp->kernel[i]].equality;
        for (int r = nlp->row_start[i]; r < nlp->row_start[i + 1]; r++) {
            double v = equality ? fabs(c[r]) : -c[r] - slack;
            if (!(v <= largest))
                largest = v;
        }
    }
    return largest;
}

/* 1/2 sum w (x - t)^2 + penalty/2 sum (c - multiplier/penalty)^2 over equalities and active rows */
static double merit(const program *nlp, const double *values, const double *c,
                    const double *multiplier, double penalty)
{
    double sum = 0;
    for (int v = 0; v < nlp->variables; v++) {
        double d = values[v] - nlp->target[v];
        sum += nlp->weight[v] * d * d;
    }
    for (int i = 0; i < nlp->instances; i++) {
        int equality = kernel_table[nlp->kernel[i]].equality;
        for (int r = nlp->row_start[i]; r < nlp->row_start[i + 1]; r++) {
            double shifted = c[r] - multiplier[r] / penalty;
            if (equality || shifted < 0)
                sum += penalty * shifted * shifted;
        }
    }
    return 0.5 * sum;
}

/* Whether any row of an instance counts. */
static int is_active(const program *nlp, int i, const double *c, const double *multiplier,
                     double penalty)
{
    if (kernel_table[nlp->kernel[i]].equality)
        return 1;
    for (int r = nlp->row_start[i]; r < nlp->row_start[i + 1]; r++)
        if (c[r] < multiplier[r] / penalty)
            return 1;
    return 0;
}

static int is_fixed(const program *nlp, int v)
{
    return v < nlp->kept || nlp->lower[v] == nlp->upper[v];
}

/* Whether no input of an instance is a variable that can move. */
static int is_still(const program *nlp, int i)
{
    const int *inputs = nlp->inputs + nlp->input_start[i];
    for (int j = 0; j < kernel_table[nlp->kernel[i]].inputs; j++)
        if (inputs[j] < nlp->variables && !is_fixed(nlp, inputs[j]))
            return 0;
    return 1;
}

/* The shape of H where some instances are active. */
static void find_shape(const program *nlp, const char *active, skyline *shape)
{
    int n = nlp->variables, *first = shape->first;
    for (int k = 0; k < n; k++)
        first[k] = k;
    for (int i = 0; i < nlp->instances; i++) {
        if (!active[i])
            continue;
        const int *inputs = nlp->inputs + nlp->input_start[i];
        int count = kernel_table[nlp->kernel[i]].inputs, smallest = n;
        for (int j = 0; j < count; j++)
            if (inputs[j] < n && nlp->order[inputs[j]] < smallest)
                smallest = nlp->order[inputs[j]];
        for (int j = 0; j < count; j++)
            if (inputs[j] < n && smallest < first[nlp->order[inputs[j]]])
                first[nlp->order[inputs[j]]] = smallest;
    }
    for (int k = 0; k < n; k++)
        shape->end[k] = k - first[k] + (k ? shape->end[k - 1] + 1 : 0);
}

/* Gradient g and Gauss-Newton matrix H. */
static void linearise(const program *nlp, const double *values, const double *c,
                      const double *multiplier, double penalty, const char *still, char *active,
                      skyline *shape, double *g, double *H)
{
    int n = nlp->variables;
    double x[LARGEST_INPUT], work[WORK], again[LARGEST_ROWS];
    double jacobian[LARGEST_ROWS * LARGEST_INPUT];
    for (int i = 0; i < nlp->instances; i++)
        active[i] = !still[i] && is_active(nlp, i, c, multiplier, penalty);
    find_shape(nlp, active, shape);
    memset(H, 0, sizeof(double) * (shape->end[n - 1] + 1));
    for (int v = 0; v < n; v++) {
        int k = nlp->order[v];
        g[k] = nlp->weight[v] * (values[v] - nlp->target[v]);
        H[shape->end[k]] = nlp->weight[v];
    }
    for (int i = 0; i < nlp->instances; i++) {
        const kernel_type *kernel = &kernel_table[nlp->kernel[i]];
        const int *inputs = nlp->inputs + nlp->input_start[i];
        int first = nlp->row_start[i];
        if (!active[i])
            continue;
        gather(nlp, i, values, x);
        const double *arguments[] = {x, nlp->parameters + nlp->parameter_start[i]};
        double *results[] = {again, jacobian};
        kernel->jacobian(arguments, results, NULL, work, 0);
        int place[LARGEST_INPUT], column[LARGEST_INPUT], count = 0;
        for (int j = 0; j < kernel->inputs; j++)
            if (inputs[j] < n) {
                place[count] = nlp->order[inputs[j]];
                column[count++] = j;
            }
        for (int r = 0; r < kernel->rows; r++) {
            double shifted = c[first + r] - multiplier[first + r] / penalty;
            if (!kernel->equality && shifted >= 0)
                continue;
            const double *row = jacobian + r * kernel->inputs;
            for (int a = 0; a < count; a++) {
                double scaled = penalty * row[column[a]];
                if (scaled == 0)
                    continue;
                g[place[a]] += scaled * shifted;
                double *H_row = row_of(shape, H, place[a]);
                for (int b = 0; b < count; b++)
                    if (place[b] <= place[a])
                        H_row[place[b]] += scaled * row[column[b]];
            }
        }
    }
}

/* Values (variables first, then constants) are changed in place, c receives the residuals.
 * Returns the number of steps tried; report: largest violation. */
int coarse_solve(const program *nlp, const settings *options, double *values, double *c,
                 double *report)
{
    int n = nlp->variables, rows = nlp->rows, tried = 0;
    int *places = malloc(sizeof(int) * 4 * n);
    skyline shape = {places, places + n};
    char *active = malloc(2 * nlp->instances), *still = active + nlp->instances;
    memset(active, 1, nlp->instances);
    memset(still, 0, nlp->instances);
    find_shape(nlp, active, &shape); /* the largest */
    size_t entries = shape.end[n - 1] + 1;
    int last_input = nlp->instances - 1, inputs = 0;
    if (last_input >= 0)
        inputs = nlp->input_start[last_input] + kernel_table[nlp->kernel[last_input]].inputs;
    double *doubles = malloc(sizeof(double) * (2 * entries + (4 + PANEL) * n + 3 * rows + inputs +
                                               nlp->instances));
    char *held = malloc(n);
    double *H = doubles, *L = H + entries, *g = L + entries, *d = g + n, *old = d + n;
    double *multiplier = old + n, *c_new = multiplier + rows, *panel = c_new + rows;
    memory last = {panel + PANEL * n, panel + PANEL * n + rows, panel + PANEL * n + rows + inputs,
                   still};
    double penalty = options->penalty, damping = options->damping;

    memset(multiplier, 0, sizeof(double) * rows);
    for (int i = 0; i < nlp->instances; i++)
        last.spare[i] = -1;
    residuals(nlp, values, multiplier, penalty, &last, c);
    for (int i = 0; i < nlp->instances; i++)
        still[i] = is_still(nlp, i);
    double worst = violation(nlp, c, options->slack), best = worst;
    int improved = 0; /* step of the last good gain on the violation */
    while (worst > options->tolerance && tried < options->steps &&
           tried - improved < options->patience) {
        double value = merit(nlp, values, c, multiplier, penalty);
        for (int inner = 0; inner < options->inner && tried < options->steps; inner++) {
            linearise(nlp, values, c, multiplier, penalty, still, active, &shape, g, H);
            for (int v = 0; v < n; v++) {
                int k = nlp->order[v];
                held[k] = is_fixed(nlp, v) ||
                          (values[v] <= nlp->lower[v] && g[k] > 0) ||
                          (values[v] >= nlp->upper[v] && g[k] < 0);
            }
            int accepted = 0;
            double gain = 0;
            for (int v = 0; v < n; v++)
                old[v] = values[v];
            while (!accepted && tried < options->steps) {
                tried++;
                if (step(n, &shape, H, g, held, damping, L, panel, places + 2 * n, d)) {
                    for (int v = nlp->kept; v < n; v++)
                        values[v] = fmin(fmax(old[v] + d[nlp->order[v]], nlp->lower[v]),
                                         nlp->upper[v]);
                    residuals(nlp, values, multiplier, penalty, &last, c_new);
                    double trial = merit(nlp, values, c_new, multiplier, penalty);
                    if (trial < value) {
                        accepted = 1;
                        gain = value - trial;
                        value = trial;
                        damping = fmax(0.2 * damping, 1e-6);
                        memcpy(c, c_new, sizeof(double) * rows);
                    }
                }
                if (!accepted) {
                    for (int v = 0; v < n; v++)
                        values[v] = old[v];
                    damping *= 5;
                    if (damping > 1e8)
                        break;
                }
            }
            worst = violation(nlp, c, options->slack);
            if (worst < 0.9 * best) {
                best = worst;
                improved = tried;
            }
            if (worst <= options->tolerance || !accepted || gain < 1e-2 * value)
                break;
        }
        damping = fmin(damping, 1e3);
        for (int i = 0; i < nlp->instances; i++) {
            int equality = kernel_table[nlp->kernel[i]].equality;
            for (int r = nlp->row_start[i]; r < nlp->row_start[i + 1]; r++) {
                double updated = multiplier[r] - penalty * c[r];
                multiplier[r] = equality ? updated : fmax(updated, 0);
            }
        }
        penalty = fmin(penalty * options->growth, options->largest_penalty);
        for (int i = 0; i < nlp->instances; i++)
            find_spare(nlp, multiplier, penalty, i, &last);
    }
    *report = worst;
    free(doubles);
    free(places);
    free(active);
    free(held);
    return tried;
}

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

/* Joints (poses, pitches, ends, candidates, outputs - 1), and the costs (poses, pitches, candidates)
 * of all ends together. */
void coarse_holds(int form, int outputs, const grid *g, double *joints, double *costs)
{
    double x[FORM_INPUTS], out[outputs];
    for (int cell = 0; cell < g->poses * g->pitches; cell++)
        for (int c = 0; c < g->candidates; c++) {
            double sum = 0;
            fill(g, cell, c, x);
            for (int e = 0; e < g->ends; e++) {
                evaluate(form, g, e, x, out);
                int row = (cell * g->ends + e) * g->candidates + c;
                memcpy(joints + row * (outputs - 1), out, sizeof(double) * (outputs - 1));
                sum += out[outputs - 1];
            }
            costs[cell * g->candidates + c] = sum;
        }
}

/* The least of these costs (poses, pitches). No cost is negative, so that a candidate whose first
 * ends cost too much need not be followed further. */
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
