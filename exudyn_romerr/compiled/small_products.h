/* Products of small matrices with a few columns, which stand side by side. */

#ifndef SMALL_PRODUCTS
#define SMALL_PRODUCTS

/* y += a A x, A (n, m), x (m, c), y (n, c) */
INLINE void add(Size n, Size m, Size c, double a, const double *A, const double *RESTRICT x, double *RESTRICT y)
{
    for (Size i = 0; i < n; i++) {
        double *RESTRICT yi = y + i * c;
        for (Size j = 0; j < m; j++) {
            const double f = a * A[i * m + j], *xj = x + j * c;
            for (Size o = 0; o < c; o++) yi[o] += f * xj[o];
        }
    }
}

/* y += a A^T x, A (n, m), x (n, c), y (m, c) */
INLINE void add_transposed(Size n, Size m, Size c, double a, const double *A, const double *x, double *RESTRICT y)
{
    for (Size i = 0; i < n; i++) {
        const double *xi = x + i * c;
        for (Size j = 0; j < m; j++) {
            const double f = a * A[i * m + j];
            for (Size o = 0; o < c; o++) y[j * c + o] += f * xi[o];
        }
    }
}

#endif
