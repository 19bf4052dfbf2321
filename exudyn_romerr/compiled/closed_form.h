/* The loops of Body.residual in mechanism/body.py, whose letters these are, and what other loops there share.

Only the products below are compiled for this machine, too: they are what takes long. */

#define AT_ONCE 4 /* rows of a motion, which share the reading of matrices */

#ifdef __GNUC__
#define ADD_SCALED(sum, a, x) sum += a * x
#else
#define ADD_SCALED(sum, a, x) \
    for (int lane = 0; lane < LANES; lane++) sum.of[lane] += a.of[lane] * x
#endif

/* Rows, each so many numbers behind the one before; 0: all of them are the same. */
typedef struct {
    const double *of;
    Size next;
} Table;

/* Some lanes of columns of add_all(), constants where this is called. */
INLINE void add_lanes(const int rows, const int lanes, Size inner, Table x, Table A, Table start, double *y,
                      Size next)
{
    Lanes sums[AT_ONCE][6], row[6];
    UNROLLED
    for (int i = 0; i < rows; i++) {
        UNROLLED
        for (int j = 0; j < lanes; j++) memcpy(&sums[i][j], start.of + i * start.next + j * LANES, sizeof(Lanes));
    }
    for (Size l = 0; l < inner; l++) {
        UNROLLED
        for (int j = 0; j < lanes; j++) memcpy(&row[j], A.of + l * A.next + j * LANES, sizeof(Lanes));
        UNROLLED
        for (int i = 0; i < rows; i++) {
            const double by = x.of[i * x.next + l];
            UNROLLED
            for (int j = 0; j < lanes; j++) { ADD_SCALED(sums[i][j], row[j], by); }
        }
    }
    UNROLLED
    for (int i = 0; i < rows; i++) {
        UNROLLED
        for (int j = 0; j < lanes; j++) memcpy(y + i * next + j * LANES, &sums[i][j], sizeof(Lanes));
    }
}

/* The last columns of add_all(), fewer than a lane has. */
INLINE void add_last(const int rows, const int columns, Size inner, Table x, Table A, Table start, double *y,
                     Size next)
{
    double sums[AT_ONCE][LANES];
    UNROLLED
    for (int i = 0; i < rows; i++) {
        UNROLLED
        for (int j = 0; j < columns; j++) sums[i][j] = start.of[i * start.next + j];
    }
    for (Size l = 0; l < inner; l++) {
        UNROLLED
        for (int i = 0; i < rows; i++) {
            UNROLLED
            for (int j = 0; j < columns; j++) sums[i][j] += x.of[i * x.next + l] * A.of[l * A.next + j];
        }
    }
    UNROLLED
    for (int i = 0; i < rows; i++) {
        UNROLLED
        for (int j = 0; j < columns; j++) y[i * next + j] = sums[i][j];
    }
}

#define FROM_HERE inner, x, (Table){A.of + q, A.next}, (Table){start.of + q, start.next}, y + q, next
#define MANY_LANES(lanes) \
    for (; q + lanes * LANES <= columns; q += lanes * LANES) add_lanes(rows, lanes, FROM_HERE)

INLINE void add_rows(const int rows, Size inner, Size columns, Table x, Table A, Table start, double *y, Size next)
{
    Size q = 0;
    if (rows == 1) MANY_LANES(6); /* sums enough at once for a processor to be busy */
    MANY_LANES(3);
    MANY_LANES(2);
    MANY_LANES(1);
    if (columns - q == 3) add_last(rows, 3, FROM_HERE);
    if (columns - q == 2) add_last(rows, 2, FROM_HERE);
    if (columns - q == 1) add_last(rows, 1, FROM_HERE);
}

/* y = start + x A for rows of x (rows, inner) and A (inner, columns); y may be start. Rows of y are `next` apart. */
INLINE void add_all(Size rows, Size inner, Size columns, Table x, Table A, Table start, double *y, Size next)
{
    while (rows) {
        const Size now = rows >= AT_ONCE ? AT_ONCE : rows == 3 ? 3 : 1;
        if (now == AT_ONCE) add_rows(AT_ONCE, inner, columns, x, A, start, y, next);
        if (now == 3) add_rows(3, inner, columns, x, A, start, y, next);
        if (now == 1) add_rows(1, inner, columns, x, A, start, y, next);
        rows -= now, x.of += now * x.next, start.of += now * start.next, y += now * next;
    }
}

/* y (rows, 3): products of rows (rows, j) of A with three x (j,). */
INLINE void project(Size rows, Size j, Table A, const double *const *x, double *y)
{
    Lanes sums[3], row, one;
    for (; rows--; A.of += A.next, y += 3) {
        Size l = 0;
        memset(sums, 0, sizeof(sums));
        for (; l + LANES <= j; l += LANES) {
            memcpy(&row, A.of + l, sizeof(row));
            UNROLLED
            for (int i = 0; i < 3; i++) {
                memcpy(&one, x[i] + l, sizeof(one));
                ADD_PRODUCT(sums[i], row, one);
            }
        }
        UNROLLED
        for (int i = 0; i < 3; i++) {
            double of[LANES];
            memcpy(of, &sums[i], sizeof(of));
            y[i] = (of[0] + of[2]) + (of[1] + of[3]);
            for (Size rest = l; rest < j; rest++) y[i] += A.of[rest] * x[i][rest];
        }
    }
}

static void add_anywhere(Size rows, Size inner, Size columns, Table x, Table A, Table start, double *y, Size next)
{
    add_all(rows, inner, columns, x, A, start, y, next);
}
static void project_anywhere(Size rows, Size j, Table A, const double *const *x, double *y)
{
    project(rows, j, A, x, y);
}
static void (*add_here)(Size, Size, Size, Table, Table, Table, double *, Size) = add_anywhere;
static void (*project_here)(Size, Size, Table, const double *const *, double *) = project_anywhere;

#ifdef WIDE
WIDE static void add_wide(Size rows, Size inner, Size columns, Table x, Table A, Table start, double *y, Size next)
{
    add_all(rows, inner, columns, x, A, start, y, next);
}
WIDE static void project_wide(Size rows, Size j, Table A, const double *const *x, double *y)
{
    project(rows, j, A, x, y);
}
#endif

static const int CYCLE[3][2] = {{1, 2}, {2, 0}, {0, 1}}; /* (a x b)_r = a_i b_j - a_j b_i */

/* factor v~ (3, 3). */
static void turn_into(double factor, const double *v, double *L)
{
    memset(L, 0, 9 * sizeof(double));
    for (int r = 0; r < 3; r++) {
        const int i = CYCLE[r][0], j = CYCLE[r][1];
        L[3 * i + j] = -factor * v[r], L[3 * j + i] = factor * v[r];
    }
}

/* y + factor a x b. */
static void add_cross(double factor, const double *a, const double *b, double *y)
{
    for (int r = 0; r < 3; r++) {
        const int i = CYCLE[r][0], j = CYCLE[r][1];
        y[r] += factor * (a[i] * b[j] - a[j] * b[i]);
    }
}

/* C + factor A B, (3, columns) of A (3, 3). */
static void add_product(double factor, const double *A, const double *B, int columns, double *C)
{
    for (int i = 0; i < 3; i++)
        for (int l = 0; l < 3; l++)
            for (int j = 0; j < columns; j++) C[i * columns + j] += factor * A[3 * i + l] * B[l * columns + j];
}

/* A body and T rows of its motion, of its first j shapes. What the text of body_residual() says. */
typedef struct {
    Size T, j, na, k;
    double mass;
    const double *w, *alpha, *b, *g, *c, *c1, *c2;
    const double *X, *XX, *Ux, *xU, *G, *twists, *M, *D, *K;
    double *rows;
    double *work;        /* as many numbers as RESIDUAL_WORK or TANGENT_WORK */
    const double *zeros; /* (k,) */
} Floating;

/* Turns and sums of a row: of y, u1, u2 (3,), and of y_i y_j, y_i u1_j, y_i u2_j. */
typedef struct {
    double w[9], S[9], Y[3], u1[3], u2[3], YY[9], Yu1[9], Yu2[9];
} RowSums;

/* Sums of row t, from those of y_i U_j, YU (9, k). */
static RowSums sums_of_row(const Floating *all, Size t, const double *YU)
{
    RowSums of;
    const Size j = all->j, k = all->k;
    const double *x[3] = {all->c + t * j, all->c1 + t * j, all->c2 + t * j};
    double by_y[27], by_x[27], by_one[9];
    project_here(9, j, (Table){YU, k}, x, by_y);
    project_here(9, j, (Table){all->xU, k}, x, by_x);
    project_here(3, j, (Table){all->Ux, k}, x, by_one);
    for (int i = 0; i < 9; i++) {
        of.YY[i] = all->XX[i] + by_y[3 * i] + by_x[3 * (3 * (i % 3) + i / 3)];
        of.Yu1[i] = by_y[3 * i + 1], of.Yu2[i] = by_y[3 * i + 2];
    }
    for (int i = 0; i < 3; i++)
        of.Y[i] = all->X[i] + by_one[3 * i], of.u1[i] = by_one[3 * i + 1], of.u2[i] = by_one[3 * i + 2];
    turn_into(1.0, all->w + 3 * t, of.w);
    turn_into(1.0, all->alpha + 3 * t, of.S);
    add_product(1.0, of.w, of.w, 3, of.S);
    return of;
}

/* Force and moment of row t; its modal rows y (6 + k,) get what turns and translations are to them. */
static void complete_row(const Floating *all, Size t, const double *YU, double *y)
{
    const RowSums of = sums_of_row(all, t, YU);
    const double *b = all->b + 3 * t, *g = all->g + 3 * t;
    double less[3], turned[9], arms[9];
    for (int i = 0; i < 3; i++) {
        less[i] = b[i] - g[i];
        y[i] = all->mass * less[i] + of.u2[i], y[3 + i] = 0.0;
        for (int j = 0; j < 3; j++) {
            turned[3 * i + j] = of.S[3 * j + i], arms[3 * i + j] = of.Yu2[3 * i + j];
            for (int l = 0; l < 3; l++)
                arms[3 * i + j] += of.YY[3 * i + l] * of.S[3 * j + l] + 2.0 * of.Yu1[3 * i + l] * of.w[3 * j + l];
        }
    }
    add_product(1.0, of.S, of.Y, 1, y);
    add_product(2.0, of.w, of.u1, 1, y);
    add_cross(1.0, of.Y, b, y + 3);
    add_cross(-1.0, all->X, g, y + 3);
    for (int r = 0; r < 3; r++) y[3 + r] += arms[3 * CYCLE[r][0] + CYCLE[r][1]] - arms[3 * CYCLE[r][1] + CYCLE[r][0]];
    add_here(1, 3, all->k, (Table){less, 0}, (Table){all->Ux, all->k}, (Table){y + 6, 0}, y + 6, 0);
    add_here(1, 9, all->k, (Table){turned, 0}, (Table){YU, all->k}, (Table){y + 6, 0}, y + 6, 0);
}

#define RESIDUAL_WORK(j, k) (AT_ONCE * (9 * (k) + (j)))

static void find_residual(const Floating *all)
{
    const Size j = all->j, k = all->k, next = 6 + k;
    double *YU = all->work, *turned = YU + AT_ONCE * 9 * k;
    for (Size t = 0; t < all->T; t += AT_ONCE) {
        const Size rows = all->T - t < AT_ONCE ? all->T - t : AT_ONCE;
        const Table c = {all->c + t * j, j}, c1 = {all->c1 + t * j, j}, c2 = {all->c2 + t * j, j};
        double *modal = all->rows + t * next + 6;
        const Table so_far = {modal, next};
        for (int i = 0; i < 9; i++)
            add_here(rows, j, k, c, (Table){all->G + i * k * k, k}, (Table){all->xU + i * k, 0}, YU + i * k, 9 * k);
        add_here(rows, j, k, c, (Table){all->K, k}, (Table){all->zeros, 0}, modal, next);
        add_here(rows, j, k, c1, (Table){all->D, k}, so_far, modal, next);
        add_here(rows, j, k, c2, (Table){all->M, k}, so_far, modal, next);
        for (int r = 0; r < 3; r++) { /* of 2 w~ u1 */
            for (Size i = 0; i < rows; i++)
                for (Size l = 0; l < j; l++) turned[i * j + l] = 2.0 * all->w[3 * (t + i) + r] * c1.of[i * j + l];
            add_here(rows, j, k, (Table){turned, j}, (Table){all->twists + r * k * k, k}, so_far, modal, next);
        }
        for (Size i = 0; i < rows; i++) complete_row(all, t + i, YU + i * 9 * k, modal + i * next - 6);
    }
}
