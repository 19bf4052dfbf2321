/* The loop of rows_times in linalg/blocked_products.py: one core, whatever BLAS does. */

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
