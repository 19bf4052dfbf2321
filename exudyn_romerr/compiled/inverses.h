/* Inverses of many small matrices, by Gauss and Jordan with the largest pivot of each column. */

typedef struct {
    Size T, n;
    double *A; /* (T, n, n), become their inverses */
    Size *order; /* n numbers */
} Inverses;

/* Whether A (n, n) has an inverse, which takes its place. */
INLINE int invert(Size n, double *A, Size *order)
{
    for (Size k = 0; k < n; k++) {
        Size best = k;
        double most = 0;
        for (Size i = k; i < n; i++) {
            const double size = A[i * n + k] < 0 ? -A[i * n + k] : A[i * n + k];
            if (size > most) most = size, best = i;
        }
        if (!(most > 0)) return 0; /* nan, too */
        order[k] = best;
        double *RESTRICT row = A + k * n;
        if (best != k)
            for (Size j = 0; j < n; j++) {
                const double swap = A[best * n + j];
                A[best * n + j] = row[j], row[j] = swap;
            }
        const double pivot = 1 / row[k];
        row[k] = 1;
        for (Size j = 0; j < n; j++) row[j] *= pivot;
        for (Size i = 0; i < n; i++) {
            if (i == k) continue;
            double *RESTRICT other = A + i * n;
            const double factor = other[k];
            other[k] = 0;
            for (Size j = 0; j < n; j++) other[j] -= factor * row[j];
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
