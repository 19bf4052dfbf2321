/* Inverses of many small bordered matrices, by Gauss and Jordan with the largest pivot of each column. */

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

typedef struct {
    Size T, n, c;
    double least;           /* of the largest diagonal entry: less is not scaled up */
    const double *A, *G, *C; /* (T, n, n), (T, c, n) twice */
    double *out, *scale;    /* (T, n + c, n + c); n + c numbers */
    Size *order;            /* n + c numbers */
} Bordered;

/* Rows and columns of [[A, G^T], [C, 0]] are scaled to a diagonal of one and constraints of length one. */
INLINE void find_scale(const Bordered *all, const double *A, const double *C)
{
    const Size n = all->n, c = all->c;
    double largest = 2.2250738585072014e-308, *scale = all->scale;
    for (Size i = 0; i < n; i++) {
        scale[i] = fabs(A[i * n + i]);
        if (scale[i] > largest) largest = scale[i];
    }
    for (Size i = 0; i < n; i++) scale[i] = 1 / sqrt(scale[i] > all->least * largest ? scale[i] : all->least * largest);
    for (Size r = 0; r < c; r++) {
        double square = 0;
        for (Size j = 0; j < n; j++) square += C[r * n + j] * scale[j] * C[r * n + j] * scale[j];
        scale[n + r] = square > 0 ? 1 / sqrt(square) : 1;
    }
}

/* How many of all have an inverse: T, or the first without. */
INLINE Size invert_bordered(const Bordered *all)
{
    const Size n = all->n, c = all->c, w = n + c;
    const double *scale = all->scale;
    for (Size t = 0; t < all->T; t++) {
        const double *A = all->A + t * n * n, *G = all->G + t * c * n, *C = all->C + t * c * n;
        double *out = all->out + t * w * w;
        find_scale(all, A, C);
        for (Size i = 0; i < n; i++) {
            for (Size j = 0; j < n; j++) out[i * w + j] = scale[i] * A[i * n + j] * scale[j];
            for (Size r = 0; r < c; r++) out[i * w + n + r] = scale[i] * G[r * n + i] * scale[n + r];
        }
        for (Size r = n; r < w; r++) {
            for (Size j = 0; j < n; j++) out[r * w + j] = scale[r] * C[(r - n) * n + j] * scale[j];
            memset(out + r * w + n, 0, c * sizeof(double));
        }
        if (!invert(w, out, all->order)) return t;
        for (Size i = 0; i < w; i++)
            for (Size j = 0; j < w; j++) out[i * w + j] *= scale[i] * scale[j];
    }
    return all->T;
}
