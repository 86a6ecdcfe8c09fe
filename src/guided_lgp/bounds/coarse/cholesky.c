/* Cholesky's factorisation of a symmetric matrix within a skyline, and steps with it. WIDEST is
 * explained in compiled.py.
 */
#include <math.h>
#include <string.h>

#define PANEL 16 /* rows that are factorised side by side */

/* Half of them. */
typedef double half_panel __attribute__((vector_size(sizeof(double) * PANEL / 2), aligned(8)));

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
 * the columns, but for those in which the panel has nothing: their numbers are not in `used`. */
WIDEST static int factorise(int n, const skyline *shape, double *H, const char *held,
                            double damping, double *L, double *panel, int *used)
{
    const int *first = shape->first;
    for (int i = 0; i < n; i += PANEL) {
        int end = i + PANEL < n ? i + PANEL : n, from = i;
        for (int r = i; r < end; r++)
            from = first[r] < from ? first[r] : from;
        memset(panel, 0, sizeof(double) * (end - from) * PANEL);
        for (int r = i; r < end; r++)
            load_row(shape, H, held, damping, r, from, panel + r - i);
        int uses = 0, *used_before = used + end - from;
        for (int j = from; j < end; j++) {
            used_before[j - from] = uses;
            double *column = panel + (j - from) * PANEL;
            const double *other = j < i ? row_of(shape, L, j) + from : panel + j - i;
            int stride = j < i ? 1 : PANEL, start = j < i && first[j] > from ? first[j] : from;
            half_panel *sums = (half_panel *)column, first_half = sums[0], second_half = sums[1];
            for (int u = used_before[start - from]; u < uses; u++) {
                int k = used[u];
                const half_panel *row = (const half_panel *)(panel + k * PANEL);
                first_half -= row[0] * other[k * stride];
                second_half -= row[1] * other[k * stride];
            }
            sums[0] = first_half, sums[1] = second_half;
            if (j >= i && !(column[j - i] > 0))
                return 0;
            double pivot = j < i ? other[j - from] : sqrt(column[j - i]);
            for (int r = 0; r < PANEL; r++)
                column[r] /= pivot;
            if (j >= i)
                column[j - i] = pivot;
            int nonzero = 0;
            for (int r = 0; r < PANEL; r++)
                nonzero |= column[r] != 0;
            if (nonzero)
                used[uses++] = j - from;
        }
        for (int r = i; r < end; r++)
            for (int k = first[r]; k <= r; k++)
                row_of(shape, L, r)[k] = panel[(k - from) * PANEL + r - i];
    }
    return 1;
}

/* Solve (H + damping) d = -g; `held` variables do not move. */
static int step(int n, const skyline *shape, double *H, const double *g, const char *held,
                double damping, double *L, double *panel, int *used, double *d)
{
    if (!factorise(n, shape, H, held, damping, L, panel, used))
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
