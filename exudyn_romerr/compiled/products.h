/* The loops of rows_times, largest_sizes and decaying_sums in linalg/blocked_products.py. */

/* What the text of rows_times() in loops.c says. */
typedef struct {
    Size S, k, m;
    const double *rows, *columns;
    double *y;
} Products;

INLINE void multiply(const Products *all)
{
    product(all->m, all->k, all->S, all->columns, all->rows, all->k, all->y, all->m);
}

/* What the text of largest_sizes() in loops.c says. */
typedef struct {
    Size S, k;
    const double *rows;
    double *y;
} Sizes;

INLINE void find_largest(const Sizes *all)
{
    const Size k = all->k;
    double *RESTRICT y = all->y;
    for (Size i = 0; i < k; i++) y[i] = 0.0;
    for (Size s = 0; s < all->S; s++)
        for (Size i = 0; i < k; i++) {
            const double size = fabs(all->rows[s * k + i]);
            y[i] = (y[i] >= size) | (y[i] != y[i]) ? y[i] : size; /* nan stays */
        }
}

/* What the text of decaying_sums() in loops.c says. */
typedef struct {
    Size rows, S;
    const double *decays, *added, *starts;
    double *y;
} Sums;

INLINE void sum_up(const Sums *all)
{
    for (Size i = 0; i < all->rows; i++) {
        const double *decays = all->decays + i * all->S, *added = all->added + i * all->S;
        double *y = all->y + i * all->S, x = all->starts[i];
        for (Size s = 0; s < all->S; s++) {
            x = isfinite(x) ? decays[s] * x + added[s] : x;
            y[s] = x = isfinite(x) ? x : HUGE_VAL;
        }
    }
}
