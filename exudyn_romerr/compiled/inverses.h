/* Inverses of many small matrices, by Gauss and Jordan with the largest pivot of each column. */

typedef struct {
    Size T, n;
    double *A; /* (T, n, n), become their inverses */
    Size *order; /* n numbers */
} Inverses;

enum { PANEL = 4 }; /* pivots at once: other rows are read and written once for all of them */

INLINE void subtract(Size n, double factor, const double *RESTRICT row, double *RESTRICT from)
{
    for (Size j = 0; j < n; j++) from[j] -= factor * row[j];
}

/* Row number k + q becomes a pivot row beside q others from k on, in whose columns it is left with what they put there. */
INLINE int take_pivot(Size n, double *A, Size k, Size q, Size *order)
{
    double *pivots = A + k * n, *row = pivots + q * n, most = 0;
    Size best = k + q;
    for (Size i = k + q; i < n; i++) {
        const double *other = A + i * n + k;
        double size = other[q];
        for (Size r = 0; r < q; r++) size -= other[r] * pivots[r * n + k + q];
        size = size < 0 ? -size : size;
        if (size > most) most = size, best = i;
    }
    if (!(most > 0)) return 0; /* nan, too */
    order[k + q] = best;
    if (best != k + q)
        for (Size j = 0; j < n; j++) {
            const double swap = A[best * n + j];
            A[best * n + j] = row[j], row[j] = swap;
        }
    double factors[PANEL];
    for (Size r = 0; r < q; r++) factors[r] = row[k + r], row[k + r] = 0;
    for (Size r = 0; r < q; r++) subtract(n, factors[r], pivots + r * n, row);
    const double pivot = 1 / row[k + q];
    row[k + q] = 1;
    for (Size j = 0; j < n; j++) row[j] *= pivot;
    for (Size r = 0; r < q; r++) {
        const double factor = pivots[r * n + k + q];
        pivots[r * n + k + q] = 0;
        subtract(n, factor, row, pivots + r * n);
    }
    return 1;
}

/* Whether A (n, n) has an inverse, which takes its place. */
INLINE int invert(Size n, double *A, Size *order)
{
    for (Size k = 0; k < n; k += PANEL) {
        const Size count = n - k < PANEL ? n - k : PANEL;
        const double *pivots = A + k * n;
        for (Size q = 0; q < count; q++)
            if (!take_pivot(n, A, k, q, order)) return 0;
        for (Size i = 0; i < n; i++) {
            if (i >= k && i < k + count) continue;
            double *RESTRICT other = A + i * n, factors[PANEL] = {0};
            for (Size r = 0; r < count; r++) factors[r] = other[k + r], other[k + r] = 0;
            if (count == PANEL)
                for (Size j = 0; j < n; j++)
                    other[j] -= factors[0] * pivots[j] + factors[1] * pivots[n + j] + factors[2] * pivots[2 * n + j] +
                                factors[3] * pivots[3 * n + j];
            else
                for (Size r = 0; r < count; r++) subtract(n, factors[r], pivots + r * n, other);
        }
    }
    for (Size k = n; k-- > 0;)
        if (order[k] != k)
            for (Size i = 0; i < n; i++) {
                const double swap = A[i * n + k];
                A[i * n + k] = A[i * n + order[k]], A[i * n + order[k]] = swap;
            }
    return 1;
}

INLINE Size invert_all(const Inverses *all)
{
    for (Size i = 0; i < all->T; i++)
        if (!invert(all->n, all->A + i * all->n * all->n, all->order)) return i;
    return all->T;
}
