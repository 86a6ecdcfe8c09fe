/* Augmented Lagrangian with Levenberg-Marquardt Gauss-Newton steps for a nonlinear program that is
 * a list of kernel instances. The translation unit starts with the generated kernels and defines
 * KERNELS (the table), REACHES (closed forms), REACH_INPUTS, LARGEST_INPUT, LARGEST_ROWS and WORK.
 * `Interpreter` in solver.py is the same algorithm on CasADi's virtual machine; keep the two alike.
 * WIDEST is explained in compiled.py.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PANEL 8 /* rows that are factorised side by side */

typedef int (*function)(const double **, double **, int *, double *, int);

typedef struct {
    function residual, jacobian;
    int inputs, rows, equality;
} kernel_type;

static const kernel_type kernel_table[] = {KERNELS};
static const function reach_table[] = {REACHES}; /* closed forms */

typedef struct {
    int variables, instances, rows;
    const int *kernel, *input_start, *inputs, *parameter_start, *row_start;
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

static void residuals(const program *nlp, const double *values, double *c)
{
    double x[LARGEST_INPUT], work[WORK];
    for (int i = 0; i < nlp->instances; i++) {
        gather(nlp, i, values, x);
        const double *arguments[] = {x, nlp->parameters + nlp->parameter_start[i]};
        double *results[] = {c + nlp->row_start[i]};
        kernel_table[nlp->kernel[i]].residual(arguments, results, NULL, work, 0);
    }
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

/* The lower triangle of a symmetric matrix, in elimination order: of row k the columns first[k] to k,
 * beyond which nothing is nonzero. They end at entry end[k]. */
typedef struct {
    int *first, *end;
} skyline;

/* Row k, such that its entry j is the one of column j. */
static double *row_of(const skyline *shape, double *entries, int k)
{
    return entries + shape->end[k] - k;
}

/* Gradient g and Gauss-Newton matrix H. */
static void linearise(const program *nlp, const skyline *shape, const double *values,
                      const double *c, const double *multiplier, double penalty, double *g,
                      double *H)
{
    int n = nlp->variables;
    double x[LARGEST_INPUT], work[WORK], again[LARGEST_ROWS];
    double jacobian[LARGEST_ROWS * LARGEST_INPUT];
    memset(H, 0, sizeof(double) * (shape->end[n - 1] + 1));
    for (int v = 0; v < n; v++) {
        int k = nlp->order[v];
        g[k] = nlp->weight[v] * (values[v] - nlp->target[v]);
        H[shape->end[k]] = nlp->weight[v];
    }
    for (int i = 0; i < nlp->instances; i++) {
        const kernel_type *kernel = &kernel_table[nlp->kernel[i]];
        const int *inputs = nlp->inputs + nlp->input_start[i];
        int first = nlp->row_start[i], active = kernel->equality;
        for (int r = 0; !active && r < kernel->rows; r++)
            active = c[first + r] < multiplier[first + r] / penalty;
        if (!active)
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

/* The shape of H for a program. */
static void find_shape(const program *nlp, skyline *shape)
{
    int n = nlp->variables, *first = shape->first;
    for (int k = 0; k < n; k++)
        first[k] = k;
    for (int i = 0; i < nlp->instances; i++) {
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

/* Row i of H + damping, with `held` variables on their own, as lane r of a panel from a column on. */
static void load_row(const skyline *shape, double *H, const char *held, double damping, int i,
                     int from, double *lane)
{
    const double *row = row_of(shape, H, i);
    for (int k = shape->first[i]; k <= i; k++)
        lane[(k - from) * PANEL] = held[i] || held[k] ? 0 : row[k];
    lane[(i - from) * PANEL] = held[i] ? 1 : row[i] + damping;
}

/* Cholesky L of H + damping within the skyline; 0 if it is not positive definite. A panel is a few
 * rows side by side, which is what processors are fast at; every entry is summed in the order of
 * the columns as ever. */
WIDEST static int factorise(int n, const skyline *shape, double *H, const char *held,
                            double damping, double *L, double *panel)
{
    const int *first = shape->first;
    for (int i = 0; i < n; i += PANEL) {
        int end = i + PANEL < n ? i + PANEL : n, from = i;
        for (int r = i; r < end; r++)
            from = first[r] < from ? first[r] : from;
        memset(panel, 0, sizeof(double) * (end - from) * PANEL);
        for (int r = i; r < end; r++)
            load_row(shape, H, held, damping, r, from, panel + r - i);
        for (int j = from; j < end; j++) {
            double sum[PANEL], *column = panel + (j - from) * PANEL;
            const double *other = j < i ? row_of(shape, L, j) + from : panel + j - i;
            int stride = j < i ? 1 : PANEL, start = j < i && first[j] > from ? first[j] : from;
            memcpy(sum, column, sizeof sum);
            for (int k = start - from; k < j - from; k++) {
                double factor = other[k * stride];
                for (int r = 0; r < PANEL; r++)
                    sum[r] -= panel[k * PANEL + r] * factor;
            }
            if (j >= i && !(sum[j - i] > 0))
                return 0;
            double pivot = j < i ? other[j - from] : sqrt(sum[j - i]);
            for (int r = 0; r < PANEL; r++)
                column[r] = sum[r] / pivot;
            if (j >= i)
                column[j - i] = pivot;
        }
        for (int r = i; r < end; r++)
            for (int k = first[r]; k <= r; k++)
                row_of(shape, L, r)[k] = panel[(k - from) * PANEL + r - i];
    }
    return 1;
}

/* Solve (H + damping) d = -g; `held` variables do not move. */
static int step(int n, const skyline *shape, double *H, const double *g, const char *held,
                double damping, double *L, double *panel, double *d)
{
    if (!factorise(n, shape, H, held, damping, L, panel))
        return 0;
    for (int i = 0; i < n; i++) {
        const double *row = row_of(shape, L, i);
        double sum = held[i] ? 0 : -g[i];
        for (int k = shape->first[i]; k < i; k++)
            sum -= row[k] * d[k];
        d[i] = sum / row[i];
    }
    for (int i = n - 1; i >= 0; i--) {
        const double *row = row_of(shape, L, i);
        d[i] /= row[i];
        for (int k = shape->first[i]; k < i; k++)
            d[k] -= row[k] * d[i];
    }
    return 1;
}

/* Values (variables first, then constants) are changed in place, c receives the residuals.
 * Returns the number of steps tried; report: largest violation. */
int coarse_solve(const program *nlp, const settings *options, double *values, double *c,
                 double *report)
{
    int n = nlp->variables, rows = nlp->rows, tried = 0;
    int *places = malloc(sizeof(int) * 2 * n);
    skyline shape = {places, places + n};
    find_shape(nlp, &shape);
    size_t entries = shape.end[n - 1] + 1;
    double *memory = malloc(sizeof(double) * (2 * entries + (4 + PANEL) * n + 2 * rows));
    char *held = malloc(n);
    double *H = memory, *L = H + entries, *g = L + entries, *d = g + n, *old = d + n;
    double *multiplier = old + n, *c_new = multiplier + rows, *panel = c_new + rows;
    double penalty = options->penalty, damping = options->damping;

    memset(multiplier, 0, sizeof(double) * rows);
    residuals(nlp, values, c);
    double worst = violation(nlp, c, options->slack), best = worst;
    int improved = 0; /* step of the last good gain on the violation */
    while (worst > options->tolerance && tried < options->steps &&
           tried - improved < options->patience) {
        double value = merit(nlp, values, c, multiplier, penalty);
        for (int inner = 0; inner < options->inner && tried < options->steps; inner++) {
            linearise(nlp, &shape, values, c, multiplier, penalty, g, H);
            for (int v = 0; v < n; v++) {
                int k = nlp->order[v];
                held[k] = (values[v] <= nlp->lower[v] && g[k] > 0) ||
                          (values[v] >= nlp->upper[v] && g[k] < 0);
            }
            int accepted = 0;
            double gain = 0;
            for (int v = 0; v < n; v++)
                old[v] = values[v];
            while (!accepted && tried < options->steps) {
                tried++;
                if (step(n, &shape, H, g, held, damping, L, panel, d)) {
                    for (int v = 0; v < n; v++)
                        values[v] = fmin(fmax(old[v] + d[nlp->order[v]], nlp->lower[v]),
                                         nlp->upper[v]);
                    residuals(nlp, values, c_new);
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
    }
    *report = worst;
    free(memory);
    free(places);
    free(held);
    return tried;
}

/* Closed-form inverse kinematics of `count` arguments (REACH_INPUTS each) to as many results. */
void coarse_reach(int form, int outputs, int count, const double *x, double *out)
{
    double work[WORK];
    for (int i = 0; i < count; i++) {
        const double *arguments[] = {x + REACH_INPUTS * i};
        double *results[] = {out + outputs * i};
        reach_table[form](arguments, results, NULL, work, 0);
    }
}
