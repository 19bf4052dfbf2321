/* The loop of norms_times in linalg/blocked_products.py: products are not written, and zeros of a triangle left out. */

#define WIDTH 3 /* lanes of products at once: with TOGETHER rows, their sums stay in registers */

#ifdef __GNUC__
#define ADD_SCALED(sum, a, x) sum += a * x
#else
#define ADD_SCALED(sum, a, x) \
    for (int lane = 0; lane < LANES; lane++) sum.of[lane] += a.of[lane] * x
#endif

/* What the text of squares() in loops.c says. */
typedef struct {
    Size S, k, blocks;
    const double *rows;
    double *columns; /* (blocks, k, WIDTH lanes), zeros behind the last */
    Size *begins;    /* of each block, its first number that is not zero */
    double *y;
} Squares;

/* Add squares of what some columns make of a few rows, a constant where this is called. */
INLINE void add_squares(const int rows, Size k, Size begin, const double *columns, const double *x, double *y)
{
    Lanes sums[TOGETHER][WIDTH], column[WIDTH];
    double of[LANES];
    memset(sums, 0, sizeof(sums));
    for (Size j = begin; j < k; j++) {
        UNROLLED
        for (int l = 0; l < WIDTH; l++) memcpy(&column[l], columns + (j * WIDTH + l) * LANES, sizeof(column[l]));
        UNROLLED
        for (int i = 0; i < rows; i++) {
            UNROLLED
            for (int l = 0; l < WIDTH; l++) { ADD_SCALED(sums[i][l], column[l], x[i * k + j]); }
        }
    }
    UNROLLED
    for (int i = 0; i < rows; i++) {
        Lanes square;
        memset(&square, 0, sizeof(square));
        UNROLLED
        for (int l = 0; l < WIDTH; l++) { ADD_PRODUCT(square, sums[i][l], sums[i][l]); }
        memcpy(of, &square, sizeof(of));
        y[i] += (of[0] + of[2]) + (of[1] + of[3]);
    }
}

INLINE void add_all_squares(const Squares *all)
{
    const Size k = all->k;
    memset(all->y, 0, all->S * sizeof(double));
    for (Size s = 0; s < all->S; s += TOGETHER)
        for (Size b = 0; b < all->blocks; b++) {
            const double *columns = all->columns + b * k * WIDTH * LANES, *x = all->rows + s * k;
            if (s + TOGETHER <= all->S)
                add_squares(TOGETHER, k, all->begins[b], columns, x, all->y + s);
            else
                for (Size i = s; i < all->S; i++)
                    add_squares(1, k, all->begins[b], columns, all->rows + i * k, all->y + i);
        }
}

/* Put columns (m, k) one beside the other, as the loop takes them. */
INLINE void arrange(Squares *all, Size m, const double *columns)
{
    const Size wide = WIDTH * LANES, k = all->k;
    for (Size b = 0; b < all->blocks; b++) all->begins[b] = k;
    for (Size i = 0; i < m; i++)
        for (Size j = 0; j < k; j++) {
            const double x = columns[i * k + j];
            all->columns[(i / wide * k + j) * wide + i % wide] = x;
            if (x != 0.0 && j < all->begins[i / wide]) all->begins[i / wide] = j;
        }
}
