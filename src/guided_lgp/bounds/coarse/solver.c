/* Augmented Lagrangian with Levenberg-Marquardt Gauss-Newton steps for a nonlinear program that is
 * a list of kernel instances. rows.c and cholesky.c come before.
 * `Interpreter` in solver.py is the same algorithm on CasADi's virtual machine; keep the two alike.
 */
typedef struct {
    double penalty, growth, largest_penalty, damping, tolerance, slack;
    int steps, inner, patience;
} settings;

/* Whether any row of an instance counts. */
static int is_active(const program *nlp, int i, const double *c, const double *multiplier,
                     double penalty)
{
    if (kernel_of(nlp, i)->equality)
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

/* The place of each variable among those that can move, in the order of elimination, or -1 for the
 * others; the number of the former. */
static int find_places(const program *nlp, int *place)
{
    int n = nlp->variables, moving = 0, *variable = malloc(sizeof(int) * n);
    for (int v = 0; v < n; v++)
        variable[nlp->order[v]] = v;
    for (int k = 0; k < n; k++)
        place[variable[k]] = is_fixed(nlp, variable[k]) ? -1 : moving++;
    free(variable);
    return moving;
}

/* The places of an instance's inputs that can move, in order, and which inputs these are; their
 * number. */
static int moving_inputs(const program *nlp, int i, const int *place, int *places, int *columns)
{
    const int *inputs = nlp->inputs + nlp->input_start[i];
    int count = 0;
    for (int j = 0; j < kernel_of(nlp, i)->inputs; j++) {
        int found = inputs[j] < nlp->variables ? place[inputs[j]] : -1, at = count;
        if (found < 0)
            continue;
        for (; at > 0 && places[at - 1] > found; at--) {
            places[at] = places[at - 1];
            columns[at] = columns[at - 1];
        }
        places[at] = found;
        columns[at] = j;
        count++;
    }
    return count;
}

/* The shape of H where some instances are active; its number of entries. */
static size_t find_shape(const program *nlp, int n, const int *place, const char *active,
                         skyline *shape)
{
    int *first = shape->first, places[LARGEST_INPUT], columns[LARGEST_INPUT];
    for (int k = 0; k < n; k++)
        first[k] = k;
    for (int i = 0; i < nlp->instances; i++) {
        int count = active[i] ? moving_inputs(nlp, i, place, places, columns) : 0;
        for (int j = 0; j < count; j++)
            if (places[0] < first[places[j]])
                first[places[j]] = places[0];
    }
    size_t entries = 0;
    for (int k = 0; k < n; k++) {
        entries += k - first[k] + 1;
        shape->end[k] = entries - 1;
    }
    return entries;
}

/* Gradient g and Gauss-Newton matrix H of the variables that can move. */
static void linearise(const program *nlp, int n, const int *place, const double *values,
                      const double *c, const double *multiplier, double penalty,
                      const char *active, skyline *shape, double *g, double *H)
{
    double x[LARGEST_INPUT], work[WORK], again[LARGEST_ROWS];
    double jacobian[LARGEST_ROWS * LARGEST_INPUT];
    memset(H, 0, sizeof(double) * find_shape(nlp, n, place, active, shape));
    for (int v = 0; v < nlp->variables; v++) {
        int k = place[v];
        if (k < 0)
            continue;
        g[k] = nlp->weight[v] * (values[v] - nlp->target[v]);
        H[shape->end[k]] = nlp->weight[v];
    }
    for (int i = 0; i < nlp->instances; i++) {
        if (!active[i])
            continue;
        const kernel_type *kernel = kernel_of(nlp, i);
        gather(nlp, i, values, x);
        const double *arguments[] = {x, nlp->parameters + nlp->parameter_start[i]};
        double *results[] = {again, jacobian};
        kernel->jacobian(arguments, results, NULL, work, 0);
        int places[LARGEST_INPUT], columns[LARGEST_INPUT], first = nlp->row_start[i];
        int count = moving_inputs(nlp, i, place, places, columns);
        for (int r = 0; r < kernel->rows; r++) {
            double shifted = c[first + r] - multiplier[first + r] / penalty;
            if (!kernel->equality && shifted >= 0)
                continue;
            double row[LARGEST_INPUT];
            for (int a = 0; a < count; a++)
                row[a] = jacobian[r * kernel->inputs + columns[a]];
            for (int a = 0; a < count; a++) {
                double scaled = penalty * row[a];
                if (scaled == 0)
                    continue;
                g[places[a]] += scaled * shifted;
                double *H_row = row_of(shape, H, places[a]);
                for (int b = 0; b < count && places[b] <= places[a]; b++)
                    H_row[places[b]] += scaled * row[b];
            }
        }
    }
}

/* Values (variables first, then constants) are changed in place, c receives the residuals.
 * Returns the number of steps tried; report: largest violation. */
int coarse_solve(const program *given, const settings *options, double *values, double *c,
                 double *report)
{
    program laid_out = *given;
    const program *nlp = &laid_out;
    int *laid = lay_out(&laid_out);
    int instances = nlp->instances, rows = nlp->rows, tried = 0;
    int *place = malloc(sizeof(int) * 5 * nlp->variables), n = find_places(nlp, place);
    int *used = place + nlp->variables;
    skyline shape = {used + 2 * n, used + 3 * n};
    char *flags = calloc(6 * instances, 1), *counts = flags, *active = flags + instances;
    char *pressed = active + instances, *held = malloc(n);
    memset(active, 1, instances);
    size_t entries = find_shape(nlp, n, place, active, &shape); /* the largest */
    int last = instances - 1;
    int inputs = instances ? nlp->input_start[last] + kernel_of(nlp, last)->inputs : 0;
    double *doubles = malloc(sizeof(double) * (2 * entries + (2 + PANEL) * n + nlp->variables +
                                               2 * rows + inputs + instances));
    double *H = doubles, *L = H + entries, *g = L + entries, *d = g + n, *panel = d + n;
    double *old = panel + PANEL * n, *multiplier = old + nlp->variables;
    memory trial = {.rows = multiplier + rows, .inputs = multiplier + 2 * rows,
                    .spare = multiplier + 2 * rows + inputs, .still = pressed + instances,
                    .counts = pressed + 2 * instances, .changed = pressed + 3 * instances};
    double penalty = options->penalty, damping = options->damping;

    memset(multiplier, 0, sizeof(double) * rows);
    memset(trial.counts, 1, instances);
    residuals(nlp, values, multiplier, penalty, &trial);
    accept(nlp, &trial, c, counts);
    for (int i = 0; i < instances; i++) {
        int places[LARGEST_INPUT], columns[LARGEST_INPUT];
        trial.still[i] = !moving_inputs(nlp, i, place, places, columns);
    }
    double worst = violation(nlp, c, counts, options->slack), best = worst;
    int improved = 0; /* step of the last good gain on the violation */
    while (worst > options->tolerance && tried < options->steps &&
           tried - improved < options->patience) {
        double value = merit(nlp, values, c, counts, multiplier, penalty);
        for (int inner = 0; inner < options->inner && tried < options->steps; inner++) {
            for (int i = 0; i < instances; i++)
                active[i] = counts[i] && !trial.still[i] &&
                            is_active(nlp, i, c, multiplier, penalty);
            linearise(nlp, n, place, values, c, multiplier, penalty, active, &shape, g, H);
            for (int v = 0; v < nlp->variables; v++) {
                old[v] = values[v];
                if (place[v] >= 0)
                    held[place[v]] = (values[v] <= nlp->lower[v] && g[place[v]] > 0) ||
                                     (values[v] >= nlp->upper[v] && g[place[v]] < 0);
            }
            hold(n, &shape, H, held);
            int accepted = 0;
            double gain = 0;
            while (!accepted && tried < options->steps) {
                tried++;
                if (step(n, &shape, H, g, held, damping, L, (lanes *)panel, used, d)) {
                    for (int v = nlp->kept; v < nlp->variables; v++) {
                        double way = place[v] < 0 ? 0 : d[place[v]];
                        values[v] = fmin(fmax(old[v] + way, nlp->lower[v]), nlp->upper[v]);
                    }
                    residuals(nlp, values, multiplier, penalty, &trial);
                    double reached = merit(nlp, values, trial.rows, trial.counts, multiplier,
                                           penalty);
                    if (reached < value) {
                        accepted = 1;
                        gain = value - reached;
                        value = reached;
                        damping = fmax(0.2 * damping, 1e-6);
                        accept(nlp, &trial, c, counts);
                    }
                }
                if (!accepted) {
                    memcpy(values, old, sizeof(double) * nlp->variables);
                    damping *= 5;
                    if (damping > 1e8)
                        break;
                }
            }
            worst = violation(nlp, c, counts, options->slack);
            if (worst < 0.9 * best) {
                best = worst;
                improved = tried;
            }
            if (worst <= options->tolerance || !accepted || gain < 1e-2 * value)
                break;
        }
        damping = fmin(damping, 1e3);
        double next = fmin(penalty * options->growth, options->largest_penalty);
        update_multipliers(nlp, c, penalty, next, &trial, multiplier, counts, pressed);
        penalty = next;
    }
    *report = worst;
    free(doubles);
    free(laid);
    free(place);
    free(flags);
    free(held);
    return tried;
}
