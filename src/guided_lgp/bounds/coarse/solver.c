/* Augmented Lagrangian with Levenberg-Marquardt Gauss-Newton steps for a nonlinear program that is
 * a list of kernel instances. The translation unit starts with the generated kernels and defines
 * KERNELS (the table), REACHES (closed forms), REACH_INPUTS, LARGEST_INPUT, LARGEST_ROWS and WORK.
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

/* Gradient g and Gauss-Newton matrix H (lower triangle, in elimination order). */
static void linearise(const program *nlp, const double *values, const double *c,
                      const double *multiplier, double penalty, double *g, double *H)
{
    int n = nlp->variables;
    double x[LARGEST_INPUT], work[WORK], again[LARGEST_ROWS];
    double jacobian[LARGEST_ROWS * LARGEST_INPUT];
    memset(H, 0, sizeof(double) * n * n);
    for (int v = 0; v < n; v++) {
        int k = nlp->order[v];
        g[k] = nlp->weight[v] * (values[v] - nlp->target[v]);
        H[k * n + k] = nlp->weight[v];
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
                for (int b = 0; b < count; b++)
                    if (place[b] <= place[a])
                        H[place[a] * n + place[b]] += scaled * row[column[b]];
            }
        }
    }
}

/* Skyline: first[k] is the first column of row k that can be nonzero. */
static void skyline(const program *nlp, int *first)
{
    int n = nlp->variables;
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
}

/* Solve (H + damping) d = -g by Cholesky within the skyline; `held` variables do not move. */
static int step(int n, const int *first, const double *H, const double *g, const char *held,
                double damping, double *L, double *d)
{
    for (int i = 0; i < n; i++) {
        double *row = L + i * n;
        for (int j = first[i]; j <= i; j++) {
            double sum = (held[i] || held[j]) ? 0 : H[i * n + j];
            if (i == j)
                sum = held[i] ? 1 : sum + damping;
            const double *other = L + j * n;
            for (int k = first[i] > first[j] ? first[i] : first[j]; k < j; k++)
                sum -= row[k] * other[k];
            if (i == j) {
                if (!(sum > 0))
                    return 0;
                row[i] = sqrt(sum);
            } else {
                row[j] = sum / other[j];
            }
        }
    }
    for (int i = 0; i < n; i++) {
        double sum = held[i] ? 0 : -g[i];
        for (int k = first[i]; k < i; k++)
            sum -= L[i * n + k] * d[k];
        d[i] = sum / L[i * n + i];
    }
    for (int i = n - 1; i >= 0; i--) {
        d[i] /= L[i * n + i];
        for (int k = first[i]; k < i; k++)
            d[k] -= L[i * n + k] * d[i];
    }
    return 1;
}

/* Values (variables first, then constants) are changed in place, c receives the residuals.
 * Returns the number of steps tried; report: largest violation. */
int coarse_solve(const program *nlp, const settings *options, double *values, double *c,
                 double *report)
{
    int n = nlp->variables, rows = nlp->rows, tried = 0;
    double *memory = malloc(sizeof(double) * (2 * (size_t)n * n + 4 * n + 2 * rows));
    int *first = malloc(sizeof(int) * n);
    char *held = malloc(n);
    double *H = memory, *L = H + n * n, *g = L + n * n, *d = g + n, *old = d + n;
    double *multiplier = old + n, *c_new = multiplier + rows;
    double penalty = options->penalty, damping = options->damping;

    skyline(nlp, first);
    memset(multiplier, 0, sizeof(double) * rows);
    residuals(nlp, values, c);
    double worst = violation(nlp, c, options->slack), best = worst;
    int improved = 0; /* step of the last good gain on the violation */
    while (worst > options->tolerance && tried < options->steps &&
           tried - improved < options->patience) {
        double value = merit(nlp, values, c, multiplier, penalty);
        for (int inner = 0; inner < options->inner && tried < options->steps; inner++) {
            linearise(nlp, values, c, multiplier, penalty, g, H);
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
                if (step(n, first, H, g, held, damping, L, d)) {
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
    free(first);
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
