/* The nonlinear program, a list of kernel instances, and its rows at some values. The translation
 * unit starts with the generated kernels and defines KERNELS (the table), LARGEST_INPUT,
 * LARGEST_ROWS, LARGEST_SHARED and WORK.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef int (*function)(const double **, double **, int *, double *, int);

/* What depends on the first inputs and parameters alone can be in a function of its own, `shared`:
 * its results are the third argument of the residual. */
typedef struct {
    function residual, jacobian, shared;
    int inputs, parameters, rows, equality, shared_inputs, shared_parameters;
} kernel_type;

static const kernel_type kernel_table[] = {KERNELS};

typedef struct {
    int variables, instances, rows, kept; /* variables that stay where they are, the first ones */
    const int *kernel, *inputs; /* of the values; constants come after the variables */
    const double *levers; /* how much a row changes at most per unit of each input */
    const double *parameters;
    const double *weight, *target, *lower, *upper;
    const int *order; /* order[v]: place of variable v in the factorisation */
    const int *input_start, *parameter_start, *row_start; /* of each instance; found here */
} program;

static const kernel_type *kernel_of(const program *nlp, int i)
{
    return kernel_table + nlp->kernel[i];
}

/* A number that, if it is negative, says how far it comes after so many others. */
static int after(int count, int number)
{
    return number < 0 ? count - 1 - number : number;
}

/* Where the inputs, parameters and rows of each instance begin, and everything numbered from 0 on:
 * Python adds actions to a program, which then has more variables. The result holds all of it. */
static int *lay_out(program *nlp)
{
    int n = nlp->variables, instances = nlp->instances, inputs = 0, alone = 0;
    for (int i = 0; i < instances; i++)
        inputs += kernel_of(nlp, i)->inputs;
    for (int v = 0; v < n; v++)
        alone += nlp->order[v] >= 0;
    int *laid = calloc(3 * (instances + 1) + inputs + n, sizeof(int));
    int *input_start = laid, *parameter_start = input_start + instances + 1;
    int *row_start = parameter_start + instances + 1, *found = row_start + instances + 1;
    int *order = found + inputs;
    for (int i = 0; i < instances; i++) {
        input_start[i + 1] = input_start[i] + kernel_of(nlp, i)->inputs;
        parameter_start[i + 1] = parameter_start[i] + kernel_of(nlp, i)->parameters;
        row_start[i + 1] = row_start[i] + kernel_of(nlp, i)->rows;
    }
    for (int j = 0; j < inputs; j++)
        found[j] = after(n, nlp->inputs[j]);
    for (int v = 0; v < n; v++)
        order[v] = after(alone, nlp->order[v]);
    nlp->input_start = input_start, nlp->parameter_start = parameter_start;
    nlp->row_start = row_start, nlp->inputs = found, nlp->order = order;
    return laid;
}

static void gather(const program *nlp, int i, const double *values, double *x)
{
    const int *inputs = nlp->inputs + nlp->input_start[i];
    for (int j = 0; j < kernel_of(nlp, i)->inputs; j++)
        x[j] = values[inputs[j]];
}

/* What a shared function gave last, and for what. */
typedef struct {
    function of;
    double x[LARGEST_INPUT], values[LARGEST_SHARED];
    const double *parameters;
} shared_values;

/* Rows that were evaluated last, where, and how far each instance was from having any effect then:
 * inequalities that are not active, nor have a multiplier, count for nothing. What cannot move is
 * still: it has been evaluated once for all. */
typedef struct {
    double *rows, *inputs, *spare;
    char *still, *counts, *changed; /* has an effect; evaluated since rows were accepted */
    shared_values shared;
} memory;

/* How far all rows of an instance are from having an effect; not positive if one has. */
static double spare_of(const program *nlp, const double *rows, const double *multiplier,
                       double penalty, int i)
{
    double least = kernel_of(nlp, i)->equality ? -1 : HUGE_VAL;
    for (int r = nlp->row_start[i]; r < nlp->row_start[i + 1]; r++) {
        double above = rows[r] - multiplier[r] / penalty;
        if (!(above >= least))
            least = above;
    }
    return 0.999 * least; /* rounding must not make it more than it is */
}

static void find_spare(const program *nlp, const double *multiplier, double penalty, int i,
                       memory *last)
{
    last->spare[i] = spare_of(nlp, last->rows, multiplier, penalty, i);
    last->counts[i] = !(last->spare[i] > 0);
}

/* Whether the inputs have not changed enough since for an instance to have an effect. */
static int is_idle(const program *nlp, int i, const double *x, const memory *last)
{
    if (last->counts[i])
        return 0;
    const double *levers = nlp->levers + nlp->input_start[i];
    const double *before = last->inputs + nlp->input_start[i];
    double way = 0;
    for (int j = 0; j < kernel_of(nlp, i)->inputs; j++)
        way += levers[j] * fabs(x[j] - before[j]);
    return way < last->spare[i];
}

/* Shared values of a kernel: of the last instance, if they are the same. */
static const double *share(const kernel_type *kernel, const double *x, const double *parameters,
                           shared_values *last, double *work)
{
    size_t inputs = sizeof(double) * kernel->shared_inputs;
    size_t given = sizeof(double) * kernel->shared_parameters;
    if (kernel->shared && !(kernel->shared == last->of && !memcmp(x, last->x, inputs) &&
                            !memcmp(parameters, last->parameters, given))) {
        const double *arguments[] = {x, parameters};
        double *results[] = {last->values};
        kernel->shared(arguments, results, NULL, work, 0);
        memcpy(last->x, x, inputs);
        last->parameters = parameters;
        last->of = kernel->shared;
    }
    return last->values;
}

/* All rows; those of idle instances are left at what they were, which has the same effect: none. */
static void residuals(const program *nlp, const double *values, const double *multiplier,
                      double penalty, memory *last)
{
    double x[LARGEST_INPUT], work[WORK];
    for (int i = 0; i < nlp->instances; i++) {
        if (last->still[i])
            continue;
        gather(nlp, i, values, x);
        if (is_idle(nlp, i, x, last))
            continue;
        const kernel_type *kernel = kernel_of(nlp, i);
        const double *parameters = nlp->parameters + nlp->parameter_start[i];
        const double *arguments[] = {x, parameters,
                                     share(kernel, x, parameters, &last->shared, work)};
        double *results[] = {last->rows + nlp->row_start[i]};
        kernel->residual(arguments, results, NULL, work, 0);
        memcpy(last->inputs + nlp->input_start[i], x, sizeof(double) * kernel->inputs);
        find_spare(nlp, multiplier, penalty, i, last);
        last->changed[i] = 1;
    }
}

/* Take the rows of the last evaluation, and which instances have an effect there. */
static void accept(const program *nlp, memory *last, double *c, char *counts)
{
    for (int i = 0; i < nlp->instances; i++)
        if (last->changed[i]) {
            int first = nlp->row_start[i], end = nlp->row_start[i + 1];
            memcpy(c + first, last->rows + first, sizeof(double) * (end - first));
            counts[i] = last->counts[i];
            last->changed[i] = 0;
        }
}

/* Largest violation, where inequalities may be violated by `slack`. */
static double violation(const program *nlp, const double *c, const char *counts, double slack)
{
    double largest = 0;
    for (int i = 0; i < nlp->instances; i++) {
        int equality = kernel_of(nlp, i)->equality;
        for (int r = nlp->row_start[i]; counts[i] && r < nlp->row_start[i + 1]; r++) {
            double v = equality ? fabs(c[r]) : -c[r] - slack;
            if (!(v <= largest))
                largest = v;
        }
    }
    return largest;
}

/* 1/2 sum w (x - t)^2 + penalty/2 sum (c - multiplier/penalty)^2 over equalities and active rows */
static double merit(const program *nlp, const double *values, const double *c, const char *counts,
                    const double *multiplier, double penalty)
{
    double sum = 0;
    for (int v = 0; v < nlp->variables; v++) {
        double d = values[v] - nlp->target[v];
        sum += nlp->weight[v] * d * d;
    }
    for (int i = 0; i < nlp->instances; i++) {
        int equality = kernel_of(nlp, i)->equality;
        for (int r = nlp->row_start[i]; counts[i] && r < nlp->row_start[i + 1]; r++) {
            double shifted = c[r] - multiplier[r] / penalty;
            if (equality || shifted < 0)
                sum += penalty * shifted * shifted;
        }
    }
    return 0.5 * sum;
}

/* New multipliers, and what has an effect with them and the next penalty. What had none in accepted
 * rows, nor a multiplier (is not `pressed`), gets none. */
static void update_multipliers(const program *nlp, const double *c, double penalty,
                               double next_penalty, memory *last, double *multiplier, char *counts,
                               char *pressed)
{
    for (int i = 0; i < nlp->instances; i++) {
        if (!counts[i] && !pressed[i])
            continue;
        int equality = kernel_of(nlp, i)->equality;
        pressed[i] = 0;
        for (int r = nlp->row_start[i]; r < nlp->row_start[i + 1]; r++) {
            double updated = multiplier[r] - penalty * c[r];
            multiplier[r] = equality ? updated : fmax(updated, 0);
            pressed[i] |= multiplier[r] != 0;
        }
        find_spare(nlp, multiplier, next_penalty, i, last);
        counts[i] = !(spare_of(nlp, c, multiplier, next_penalty, i) > 0);
    }
}
