/* The loops of Body.tangent and Motion.moved in mechanism/body.py on what is in closed_form.h. */

/* What the text of body_tangent() says. Rows of unknowns (T, s, s) and of their coupling (T, s, m). */
typedef struct {
    Floating body;
    Size s, m;
    const double *G_back; /* (9, na, m): G of oscillators' rows, transposed */
    double *M, *D, *K, *coupled_M, *coupled_D, *coupled_K, *D_back, *K_back;
} Tangent;

/* What a row has of sums of shapes U, (k,) each: y_i U_j, u1_i U_j, crossed u2 and U, U. */
enum { OF_Y = 0, OF_U1 = 9, OF_U2 = 18, OF_ONE = 21, PARTS = 24 };
enum { FACTORS = 3 * 9 }; /* of a row, for its modal rows: 2 w~, - 2 w~, S */

#define TANGENT_WORK(na, k) (AT_ONCE * (PARTS * (k) + FACTORS) + 6 * (na))

/* Put L (3, 3) into a matrix whose rows are s numbers apart. */
static void put(const double *L, double *into, Size s)
{
    for (int i = 0; i < 3; i++) memcpy(into + i * s, L + 3 * i, 3 * sizeof(double));
}

/* Factors (3, PARTS) + those of factor times the sum of y x (L z), from sums y_i z_j; of z_i y_j if is_swapped. */
static void add_crossed(double factor, const double *L, int begin, int is_swapped, double *factors)
{
    for (int r = 0; r < 3; r++) {
        const int i = CYCLE[r][0], j = CYCLE[r][1];
        double *of = factors + r * PARTS + begin;
        for (int l = 0; l < 3; l++) {
            of[is_swapped ? 3 * l + i : 3 * i + l] += factor * L[3 * j + l];
            of[is_swapped ? 3 * l + j : 3 * j + l] -= factor * L[3 * i + l];
        }
    }
}

/* Factors (4, 3, PARTS) of moments' rows of M, D, K, and of modal rows of D: columns of rotations, transposed. */
static void find_factors(const RowSums *of, const double *b, double *factors)
{
    static const double unit[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    double *of_M = factors, *of_D = factors + 3 * PARTS, *of_K = factors + 6 * PARTS, *modal = factors + 9 * PARTS;
    memset(factors, 0, 12 * PARTS * sizeof(double));
    add_crossed(1.0, unit, OF_Y, 0, of_M);
    add_crossed(2.0, of->w, OF_Y, 0, of_D);
    for (int is_swapped = 0; is_swapped < 2; is_swapped++) {
        add_crossed(1.0, of->S, OF_Y, is_swapped, of_K);
        add_crossed(-1.0, of->w, OF_Y, is_swapped, modal);
    }
    add_crossed(2.0, of->w, OF_U1, 1, of_K);
    add_crossed(2.0, unit, OF_U1, 0, modal);
    add_product(1.0, of->w, of_M, PARTS, modal);
    for (int r = 0; r < 3; r++) {
        const int i = CYCLE[r][0], j = CYCLE[r][1];
        of_K[r * PARTS + OF_U2 + r] = -1.0;
        of_K[r * PARTS + OF_ONE + i] += b[j], of_K[r * PARTS + OF_ONE + j] -= b[i];
    }
}

/* Blocks of frames: of forces and moments, by translations and rotations. */
static void put_frame(const Tangent *all, Size t, const RowSums *of)
{
    const Floating *body = &all->body;
    const Size s = all->s;
    const double *b = body->b + 3 * t, *g = body->g + 3 * t;
    const double trace = of->YY[0] + of->YY[4] + of->YY[8], trace1 = of->Yu1[0] + of->Yu1[4] + of->Yu1[8];
    double *M = all->M + t * s * s, *D = all->D + t * s * s, *K = all->K + t * s * s;
    double y[9], J[9], L[9], L_b[9], L_g[9], less[3], v[3] = {of->u1[0], of->u1[1], of->u1[2]}, h[3] = {0.0};
    const double w[3] = {of->w[7], of->w[2], of->w[3]};
    turn_into(-1.0, of->Y, y), put(y, M + 3, s);
    turn_into(1.0, of->Y, y), put(y, M + 3 * s, s);
    for (int i = 0; i < 9; i++) J[i] = (i % 4 == 0 ? trace : 0.0) - of->YY[i];
    put(J, M + 3 * s + 3, s);
    add_product(1.0, of->w, of->Y, 1, v);
    turn_into(-2.0, v, L), put(L, D + 3, s); /* y~ w~ - w~ y~ = - (w x y)~ */
    add_product(1.0, of->YY, w, 1, h);
    turn_into(1.0, h, L); /* of y x (v x (w x y) + w x (v x y) + 2 v x u1), by v */
    add_product(-1.0, of->w, of->YY, 3, L);
    add_product(-1.0, J, of->w, 3, L);
    for (int r = 0; r < 3; r++)
        for (int i = 0; i < 3; i++) {
            const int a = CYCLE[r][0], c = CYCLE[r][1];
            L[3 * r + i] += 2.0 * ((i == r ? trace1 : 0.0) - of->Yu1[3 * i + r]);
            L[3 * r + i] -= 2.0 * w[i] * (of->YY[3 * a + c] - of->YY[3 * c + a]);
        }
    put(L, D + 3 * s + 3, s);
    for (int i = 0; i < 3; i++) {
        less[i] = b[i] - g[i];
        for (int j = 0; j < 3; j++) {
            M[i * s + j] = i == j ? body->mass : 0.0;
            D[i * s + j] = D[(3 + i) * s + j] = K[i * s + j] = K[(3 + i) * s + j] = 0.0;
        }
    }
    turn_into(body->mass, less, L), put(L, K + 3, s);
    memset(L, 0, sizeof(L));
    turn_into(1.0, b, L_b), add_product(1.0, y, L_b, 3, L);
    turn_into(1.0, body->X, y), turn_into(1.0, g, L_g), add_product(-1.0, y, L_g, 3, L);
    put(L, K + 3 * s + 3, s);
}

/* Three rows of unknowns and of their coupling: products of factors (3, count) with A (count, k). */
static void put_rows(const Tangent *all, Table factors, Size count, const double *A, double *own, Size s,
                     double *coupled)
{
    const Size na = all->body.na, k = all->body.k;
    const Table zeros = {all->body.zeros, 0};
    add_here(3, count, na, factors, (Table){A, k}, zeros, own, s);
    add_here(3, count, all->m, factors, (Table){A + na, k}, zeros, coupled, all->m);
}

/* Row t but for modal rows by shapes, from its parts (PARTS, k); `columns` (2, 3, na) is for its modal columns. */
static void put_row(const Tangent *all, Size t, const double *parts, double *factors_of, double *columns)
{
    const Floating *body = &all->body;
    const Size s = all->s, m = all->m, na = body->na, k = body->k, square = t * s * s, coupled = t * s * m;
    const RowSums of = sums_of_row(body, t, parts + OF_Y * k);
    const double *b = body->b + 3 * t, *g = body->g + 3 * t, *Ux = body->Ux;
    const double less[3] = {b[0] - g[0], b[1] - g[1], b[2] - g[2]};
    double factors[12 * PARTS], w2[9], L[9];
    for (int i = 0; i < 9; i++) {
        w2[i] = factors_of[i] = 2.0 * of.w[i];
        factors_of[9 + i] = -w2[i], factors_of[18 + i] = of.S[i];
    }
    put_frame(all, t, &of);
    find_factors(&of, b, factors);
    for (int r = 0; r < 3; r++) {
        memcpy(all->M + square + r * s + 6, Ux + r * k, na * sizeof(double));
        memcpy(all->coupled_M + coupled + r * m, Ux + r * k + na, m * sizeof(double));
    }
    put_rows(all, (Table){w2, 3}, 3, Ux, all->D + square + 6, s, all->coupled_D + coupled);
    put_rows(all, (Table){of.S, 3}, 3, Ux, all->K + square + 6, s, all->coupled_K + coupled);
    double *const own[] = {all->M, all->D, all->K};
    double *const others[] = {all->coupled_M, all->coupled_D, all->coupled_K};
    for (int i = 0; i < 3; i++)
        put_rows(all, (Table){factors + 3 * i * PARTS, PARTS}, PARTS, parts, own[i] + square + 3 * s + 6, s,
                 others[i] + coupled + 3 * m);
    memset(all->D_back + coupled, 0, 3 * m * sizeof(double));
    memset(all->K_back + coupled, 0, 3 * m * sizeof(double));
    put_rows(all, (Table){factors + 9 * PARTS, PARTS}, PARTS, parts, columns, na, all->D_back + coupled + 3 * m);
    turn_into(-1.0, less, L);
    put_rows(all, (Table){L, 3}, 3, Ux, columns + 3 * na, na, all->K_back + coupled + 3 * m);
    for (Size a = 0; a < na; a++)
        for (int r = 0; r < 3; r++) {
            const Size place = square + (6 + a) * s + r;
            all->M[place] = Ux[r * k + a], all->M[place + 3] = all->M[square + (3 + r) * s + 6 + a];
            all->D[place] = all->K[place] = 0.0;
            all->D[place + 3] = columns[r * na + a], all->K[place + 3] = columns[(3 + r) * na + a];
        }
}

/* Modal rows by shapes of some rows from t on, by their factors (FACTORS,). */
static void put_modal(const Tangent *all, Size t, Size rows, const double *factors_of)
{
    const Floating *body = &all->body;
    const Size s = all->s, m = all->m, na = body->na, k = body->k;
    const Table w2 = {factors_of, FACTORS}, less_w2 = {factors_of + 9, FACTORS}, S = {factors_of + 18, FACTORS};
    for (Size a = 0; a < na; a++) {
        const Size own = t * s * s + (6 + a) * s + 6, other = t * s * m + (6 + a) * m;
        const Table G = {body->G + a * k, k * k}, beside = {G.of + na, k * k}, G_back = {all->G_back + a * m, na * m};
        const Table D = {body->D + a * k, 0}, beside_D = {D.of + na, 0};
        const Table K = {body->K + a * k, 0}, beside_K = {K.of + na, 0};
        for (Size i = 0; i < rows; i++) {
            memcpy(all->M + own + i * s * s, body->M + a * k, na * sizeof(double));
            memcpy(all->coupled_M + other + i * s * m, body->M + a * k + na, m * sizeof(double));
        }
        add_here(rows, 9, na, w2, G, D, all->D + own, s * s);
        add_here(rows, 9, m, w2, beside, beside_D, all->coupled_D + other, s * m);
        add_here(rows, 9, m, less_w2, beside, beside_D, all->D_back + other, s * m);
        add_here(rows, 9, na, S, G, K, all->K + own, s * s);
        add_here(rows, 9, m, S, beside, beside_K, all->coupled_K + other, s * m);
        add_here(rows, 9, m, S, G_back, beside_K, all->K_back + other, s * m);
    }
}

static void find_tangent(const Tangent *all)
{
    const Floating *body = &all->body;
    const Size j = body->j, k = body->k, next = PARTS * k;
    double *parts = body->work, *factors = parts + AT_ONCE * next, *columns = factors + AT_ONCE * FACTORS;
    const Table zeros = {body->zeros, 0};
    for (int i = 0; i < AT_ONCE; i++) memcpy(parts + i * next + OF_ONE * k, body->Ux, 3 * k * sizeof(double));
    for (Size t = 0; t < body->T; t += AT_ONCE) {
        const Size rows = body->T - t < AT_ONCE ? body->T - t : AT_ONCE;
        const Table c = {body->c + t * j, j}, c1 = {body->c1 + t * j, j}, c2 = {body->c2 + t * j, j};
        for (int i = 0; i < 9; i++) {
            const Table G = {body->G + i * k * k, k};
            add_here(rows, j, k, c, G, (Table){body->xU + i * k, 0}, parts + (OF_Y + i) * k, next);
            add_here(rows, j, k, c1, G, zeros, parts + (OF_U1 + i) * k, next);
        }
        for (int r = 0; r < 3; r++)
            add_here(rows, j, k, c2, (Table){body->twists + r * k * k, k}, zeros, parts + (OF_U2 + r) * k, next);
        for (Size i = 0; i < rows; i++) put_row(all, t + i, parts + i * next, factors + i * FACTORS, columns);
        put_modal(all, t, rows, factors);
    }
}

/* A motion, T rows of (3, 3), (3,) four times, (j,) three times. */
typedef struct {
    double *A, *w, *alpha, *b, *g, *c[3];
} Motion;

/* What the text of moved_motion() says. */
typedef struct {
    Size T, j, k;
    Motion from, to;
    double *e[3];
} Moved;

/* y = A^T v; y is not v. */
static void times_transposed(const double *A, const double *v, double *y)
{
    for (int i = 0; i < 3; i++) y[i] = A[i] * v[0] + A[3 + i] * v[1] + A[6 + i] * v[2];
}

/* E = exp(v~). */
static void exponential(const double *v, double *E)
{
    const double angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const int is_small = angle < 1e-8; /* SMALL in mechanism/rotations.py */
    const double first = is_small ? 1.0 : sin(angle) / angle;
    const double second = is_small ? 0.5 : (1.0 - cos(angle)) / (angle * angle);
    double L[9];
    turn_into(1.0, v, L), turn_into(first, v, E);
    E[0] += 1.0, E[4] += 1.0, E[8] += 1.0;
    add_product(second, L, L, 3, E);
}

/* along_screw of mechanism/rotations.py: of phi, phi', ... and count of x, x', ..., these into y. */
static void along_screw(const double (*phi)[3], const double (*x)[3], int count, double (*y)[3])
{
    static const double choose[3][3] = {{1.0, 0.0, 0.0}, {1.0, 1.0, 0.0}, {1.0, 2.0, 1.0}};
    double term[3][3], next[3][3];
    memcpy(term, x, count * sizeof(*x));
    memcpy(y, x, count * sizeof(*x));
    for (int k = 2; k <= 7; k++) { /* SERIES in mechanism/rotations.py */
        memset(next, 0, sizeof(next));
        for (int n = 0; n < count; n++)
            for (int m = 0; m <= n; m++) add_cross(choose[n][m] / k, phi[m], term[n - m], next[n]);
        memcpy(term, next, sizeof(next));
        for (int n = 0; n < count; n++)
            for (int i = 0; i < 3; i++) y[n][i] += term[n][i];
    }
}

static void move(const Moved *all)
{
    const Motion *from = &all->from, *to = &all->to;
    const Size j = all->j, k = all->k, next = 6 + k;
    for (Size t = 0; t < all->T; t++) {
        const double *A = from->A + 9 * t, *w = from->w + 3 * t, *alpha = from->alpha + 3 * t;
        double phi[3][3], back[3][3], shift[3][3], moved[3][3], turned[2][3], E[9], b[3];
        for (int i = 0; i < 3; i++) {
            times_transposed(A, all->e[i] + t * next, shift[i]);
            times_transposed(A, all->e[i] + t * next + 3, phi[i]);
            for (int r = 0; r < 3; r++) back[i][r] = -phi[i][r];
        }
        along_screw((const double(*)[3])phi, (const double(*)[3])shift, 3, moved);
        along_screw((const double(*)[3])back, (const double(*)[3])(phi + 1), 2, turned);
        for (int i = 0; i < 3; i++) {
            to->w[3 * t + i] = w[i] + turned[0][i];
            to->alpha[3 * t + i] = alpha[i] + turned[1][i];
            b[i] = from->b[3 * t + i] + moved[2][i];
        }
        add_cross(-1.0, w, turned[0], to->alpha + 3 * t);
        exponential(phi[0], E);
        memset(to->A + 9 * t, 0, sizeof(E));
        add_product(1.0, A, E, 3, to->A + 9 * t);
        times_transposed(E, b, to->b + 3 * t);
        times_transposed(E, from->g + 3 * t, to->g + 3 * t);
        for (int i = 0; i < 3; i++) {
            const double *e = all->e[i] + t * next + 6, *c = from->c[i] + t * j;
            double *moved = to->c[i] + t * k;
            memcpy(moved, e, k * sizeof(double));
            for (Size l = 0; l < j; l++) moved[l] += c[l];
        }
    }
}
