/* Cholesky's factorisation of a symmetric matrix within a skyline, and steps with it. WIDEST is
 * explained in compiled.py.
 */
#include <math.h>
#include <string.h>

#define PANEL 8 /* rows that are factorised side by side */

typedef double lanes __attribute__((vector_size(sizeof(double) * PANEL), aligned(8)));
typedef long long mask __attribute__((vector_size(sizeof(double) * PANEL), aligned(8)));

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

/* Variables that are held do not move: nothing else depends on them. */
static void hold(int n, const skyline *shape, double *H, const char *held)
{
    for (int k = 0; k < n; k++) {
        if (!held[k])
            continue;
        for (int j = shape->first[k]; j < k; j++)
            row_of(shape, H, k)[j] = 0;
        for (int i = k + 1; i < n; i++)
            if (shape->first[i] <= k)
                row_of(shape, H, i)[k] = 0;
    }
}

static INLINE int any_nonzero(lanes column)
{
    mask found = column != 0;
    long long any = 0;
    for (int r = 0; r < PANEL; r++)
        any |= found[r];
    return any != 0;
}

/* Rows i to end of H + damping, from a column on, as lanes of a panel. */
static INLINE void load(const skyline *shape, double *H, double damping, int i, int end, int from,
                        lanes *panel)
{
    memset(panel, 0, sizeof(lanes) * (end - from));
    for (int r = i; r < end; r++) {
        const double *row = row_of(shape, H, r);
        double *lane = (double *)panel + r - i;
        for (int k = shape->first[r]; k < r; k++)
            lane[(k - from) * PANEL] = row[k];
        lane[(r - from) * PANEL] = row[r] + damping;
    }
}

/* Cholesky L of H + damping within the skyline, and the d of L d = -g; 0 if it is not positive
 * definite. A panel is a few rows side by side, which is what processors are fast at; every entry
 * is summed in the order of the columns, but for those in which the panel has nothing: their numbers
 * are not in `used`. */
WIDEST static int factorise(int n, const skyline *shape, double *H, const double *g,
                            const char *held, double damping, double *L, lanes *panel, int *used,
                            double *d)
{
    const int *first = shape->first;
    for (int i = 0; i < n; i += PANEL) {
        int end = i + PANEL < n ? i + PANEL : n, from = i;
        for (int r = i; r < end; r++)
            from = first[r] < from ? first[r] : from;
        load(shape, H, damping, i, end, from, panel);
        lanes right = {0};
        double *entries = (double *)panel, *rest = (double *)&right;
        for (int r = i; r < end; r++)
            rest[r - i] = held[r] ? 0 : -g[r];
        int uses = 0, *used_before = used + end - from;
        for (int j = from; j < end; j++) {
            used_before[j - from] = uses;
            lanes sums = panel[j - from];
            const double *other = j < i ? row_of(shape, L, j) + from : entries + j - i;
            int stride = j < i ? 1 : PANEL, start = j < i && first[j] > from ? first[j] : from;
            for (int u = used_before[start - from]; u < uses; u++)
                sums -= panel[used[u]] * other[used[u] * stride];
            panel[j - from] = sums;
            if (j < i && !any_nonzero(sums))
                continue;
            double *diagonal = j < i ? NULL : entries + (j - from) * PANEL + j - i;
            double pivot = diagonal ? sqrt(*diagonal) : other[j - from];
            if (!(pivot > 0))
                return 0;
            panel[j - from] = sums /= pivot;
            if (diagonal) {
                *diagonal = pivot;
                d[j] = rest[j - i] / pivot;
            }
            right -= sums * d[j];
            used[uses++] = j - from;
        }
        for (int r = i; r < end; r++)
            for (int k = first[r]; k <= r; k++)
                row_of(shape, L, r)[k] = entries[(k - from) * PANEL + r - i];
    }
    return 1;
}

/* The d of L' d = d. */
WIDEST static void substitute_back(int n, const skyline *shape, double *L, double *d)
{
    for (int i = n - 1; i >= 0; i--) {
        const double *row = row_of(shape, L, i);
        int k = shape->first[i];
        double found = d[i] /= row[i];
        for (; k + PANEL <= i; k += PANEL)
            *(lanes *)(d + k) -= *(const lanes *)(row + k) * found;
        for (; k < i; k++)
            d[k] -= row[k] * found;
    }
}

/* Solve (H + damping) d = -g, with variables held as above. */
static int step(int n, const skyline *shape, double *H, const double *g, const char *held,
                double damping, double *L, lanes *panel, int *used, double *d)
{
    if (!factorise(n, shape, H, g, held, damping, L, panel, used, d))
        return 0;
    substitute_back(n, shape, L, d);
    return 1;
}
