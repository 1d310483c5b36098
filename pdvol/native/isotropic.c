/* Filtered Hessians of isotropic energies in 3D, LANES domains at a time.
 *
 * In the frames of F = U S V' the Hessian over F of an isotropic energy psi(s0, s1, s2) falls apart into the 3 x 3 matrix of second
 * derivatives by the stretches and a 2 x 2 block per pair of axes with eigenvalues (psi_i - psi_j) / (s_i - s_j) and
 * (psi_i + psi_j) / (s_i + s_j) (Smith, de Goes, Kim 2019). Each is filtered by itself before the
 * Hessian is turned back. */
#include "domain.h"

enum { GROUPS = 2 }; /* of LANES domains whose eigensystems are found together: a sixth less time for a Hessian than with one */

INLINE lanes root(lanes a)
{
    lanes r;
    for (int l = 0; l < LANES; ++l)
        r[l] = sqrt(a[l]);
    return r;
}

/* Of eight numbers of each lane, those of one lane together: halves, then single ones of four by four are exchanged. */
INLINE void transpose(const lanes rows[8], eight columns[LANES])
{
    for (int group = 0; group < LANES; group += 4)
        for (int part = 0; part < FOURS; ++part) {
            four r[4];
            for (int k = 0; k < 4; ++k)
                for (int l = 0; l < 4; ++l)
                    r[k][l] = rows[4 * part + k][group + l];
            const four a = {r[0][0], r[0][1], r[2][0], r[2][1]}, b = {r[0][2], r[0][3], r[2][2], r[2][3]};
            const four c = {r[1][0], r[1][1], r[3][0], r[3][1]}, e = {r[1][2], r[1][3], r[3][2], r[3][3]};
            columns[group].part[part] = (four){a[0], c[0], a[2], c[2]};
            columns[group + 1].part[part] = (four){a[1], c[1], a[3], c[3]};
            columns[group + 2].part[part] = (four){b[0], e[0], b[2], e[2]};
            columns[group + 3].part[part] = (four){b[1], e[1], b[3], e[3]};
        }
}

/* Turns the axes p and q of the symmetric matrices A such that A_pq becomes zero, and the columns of V with them. */
INLINE void rotate(int p, int q, lanes A[3][3], lanes V[3][3])
{
    const int o = 3 - p - q;
    const lanes apq = A[p][q], half = 0.5 * (A[q][q] - A[p][p]);
    /* t = tan of the smaller angle, written so that apq = 0 gives t = 0 without a division by zero. */
    const lanes length = root(half * half + apq * apq);
    const lanes below = magnitude(half) + length;
    lanes t = apq / choose(below > all(0.0), below, all(1.0));
    t = choose(half < all(0.0), -t, t);
    const lanes c = 1.0 / root(t * t + 1.0), s = t * c;
    A[p][p] -= t * apq;
    A[q][q] += t * apq;
    A[p][q] = A[q][p] = all(0.0);
    const lanes aop = A[o][p], aoq = A[o][q];
    A[o][p] = A[p][o] = c * aop - s * aoq;
    A[o][q] = A[q][o] = s * aop + c * aoq;
    for (int k = 0; k < 3; ++k) {
        const lanes vp = V[k][p], vq = V[k][q];
        V[k][p] = c * vp - s * vq;
        V[k][q] = s * vp + c * vq;
    }
}

/* Whether some A has entries off its diagonal that count. */
INLINE int coupled(lanes A[3][3])
{
    const lanes off = A[0][1] * A[0][1] + A[0][2] * A[0][2] + A[1][2] * A[1][2];
    const lanes diagonal = A[0][0] * A[0][0] + A[1][1] * A[1][1] + A[2][2] * A[2][2];
    const mask over = off > (ROUND_OFF * ROUND_OFF) * diagonal;
    int64_t any = 0;
    for (int l = 0; l < LANES; ++l)
        any |= over[l];
    return any != 0;
}

/* Cyclic Jacobi of `groups` times LANES symmetric 3 x 3 matrices A: they become diagonal, and the columns of V eigenvectors. A rotation is a chain
 * of roots and quotients; the processor waits less where it has several such chains. */
INLINE void eigensystems(int groups, lanes A[][3][3], lanes V[][3][3])
{
    for (int g = 0; g < groups; ++g)
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                V[g][i][j] = all(i == j);
    for (int sweep = 0; sweep < MAX_ROUNDS; ++sweep) {
        int open = 0;
        for (int g = 0; g < groups; ++g)
            open |= coupled(A[g]);
        if (!open)
            return;
        for (int o = 2; o >= 0; --o) /* the axes 0 1, 0 2, 1 2 */
            for (int g = 0; g < groups; ++g)
                rotate(o == 0, o == 2 ? 1 : 2, A[g], V[g]);
    }
}

/* Whether the symmetric 3 x 3 matrices of all lanes are positive definite, and not only just: by their leading minors. */
INLINE int all_definite(lanes A[3][3])
{
    const lanes minor = A[0][0] * A[1][1] - A[0][1] * A[0][1], product = A[0][0] * A[1][1];
    const lanes determinant = minor * A[2][2] - A[1][2] * (A[0][0] * A[1][2] - A[0][1] * A[0][2])
                              + A[0][2] * (A[0][1] * A[1][2] - A[1][1] * A[0][2]);
    const mask definite = (A[0][0] > all(0.0)) & (minor > 1e-10 * product) & (determinant > 1e-10 * (product * A[2][2]))
                          & (A[2][2] > all(0.0));
    int64_t every = -1;
    for (int l = 0; l < LANES; ++l)
        every &= definite[l];
    return every != 0;
}

/* What becomes of an eigenvalue: mode 0 keeps it, 1 cuts it off at zero, 2 takes its size. */
INLINE lanes positive(lanes a, int mode)
{
    if (mode == 0)
        return a;
    return mode == 1 ? choose(a < all(0.0), all(0.0), a) : magnitude(a);
}

/* Adds weight times the Hessians of the domains from `first` on, with F and right axes V of stretching. Returns the next domain's slots. */
INLINE const int32_t *add_hessians(int cells, const domains_t *domains, const density_t *density, const density_t *second, int64_t first,
                                   lanes F[3][3], lanes V[3][3], const int32_t *slots, int mode, double weight, double *out)
{
    const int used = lanes_used(domains->count, first);
    const lanes scale = weight * volumes_of(domains, first);
    lanes U[3][3], s[3];
    for (int q = 0; q < 3; ++q) {
        for (int a = 0; a < 3; ++a)
            U[a][q] = F[a][0] * V[0][q] + F[a][1] * V[1][q] + F[a][2] * V[2][q];
        s[q] = root(U[0][q] * U[0][q] + U[1][q] * U[1][q] + U[2][q] * U[2][q]);
        for (int a = 0; a < 3; ++a)
            U[a][q] /= s[q];
    }
    lanes p[3], S[3][3], w[3 + MAX_PARAMETERS];
    coefficients(density, first, 3, s, w);
    CALL(density->kernel, p, w);
    coefficients(second, first, 3, s, w);
    CALL(second->kernel, S, w);
    lanes same[3], cross[3]; /* of the axes other than o: H over (F_ij, F_ij) and over (F_ij, F_ji) */
    for (int o = 0; o < 3; ++o) {
        const int i = (o + 1) % 3, j = (o + 2) % 3;
        const lanes difference = s[i] - s[j], total = s[i] + s[j];
        const mask near = magnitude(difference) < 1e-5 * total; /* there the quotient's limit is exact to second order */
        const lanes flip = choose(near, 0.5 * (S[i][i] + S[j][j]) - S[i][j], (p[i] - p[j]) / choose(near, total, difference));
        const lanes twist = (p[i] + p[j]) / total;
        const lanes even = positive(flip, mode), odd = positive(twist, mode);
        same[o] = 0.5 * (even + odd);
        cross[o] = 0.5 * (even - odd);
    }
    if (mode && !all_definite(S)) {
        lanes A[3][3], Q[3][3];
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                A[i][j] = S[i][j];
        eigensystems(1, &A, &Q);
        const mask indefinite = (A[0][0] < all(0.0)) | (A[1][1] < all(0.0)) | (A[2][2] < all(0.0));
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                lanes sum = all(0.0);
                for (int q = 0; q < 3; ++q)
                    sum += positive(A[q][q], mode) * Q[i][q] * Q[j][q];
                S[i][j] = choose(indefinite, sum, S[i][j]);
            }
    }
    /* H[q][r] over the columns q and r of F V, 3 x 3 blocks in space: products of columns of U. */
    lanes H[3][3][9], half[3][3][9];
    for (int q = 0; q < 3; ++q)
        for (int r = q; r < 3; ++r)
            for (int a = 0; a < 9; ++a) {
                const int i = a / 3, k = a % 3, m = (q + 1) % 3, n = (q + 2) % 3; /* the axes of (q, m) leave n out */
                const lanes own = scale * S[q][r] * U[i][q] * U[k][r];
                if (q == r)
                    H[q][q][a] = own + scale * (same[n] * U[i][m] * U[k][m] + same[m] * U[i][n] * U[k][n]);
                else
                    H[q][r][a] = H[r][q][3 * k + i] = own + scale * cross[3 - q - r] * U[i][r] * U[k][q];
            }
    /* The same over columns of F. */
    for (int j = 0; j < 3; ++j)
        for (int r = 0; r < 3; ++r)
            for (int a = 0; a < 9; ++a)
                half[j][r][a] = V[j][0] * H[0][r][a] + V[j][1] * H[1][r][a] + V[j][2] * H[2][r][a];
    for (int j = 0; j < 3; ++j)
        for (int m = j; m < 3; ++m)
            for (int a = 0; a < 9; ++a)
                H[j][m][a] = half[j][0][a] * V[m][0] + half[j][1][a] * V[m][1] + half[j][2][a] * V[m][2];
    block_t blocks[LANES][3][3];
    for (int j = 0; j < 3; ++j)
        for (int m = 0; m < 3; ++m) {
            lanes one[8];
            eight heads[LANES];
            for (int a = 0; a < 8; ++a)
                one[a] = j <= m ? H[j][m][a] : H[m][j][3 * (a % 3) + a / 3];
            transpose(one, heads);
            for (int l = 0; l < LANES; ++l)
                blocks[l][j][m] = (block_t){heads[l], H[j < m ? j : m][j < m ? m : j][8][l]};
        }
    for (int l = 0; l < used; ++l)
        slots = add_blocks(cells, domain_at(cells, domains, first + l), blocks[l], slots, out);
    return slots;
}

INLINE void isotropic(int cells, const domains_t *domains, const density_t *density, const density_t *second, const double *x, const int32_t *slots,
                      int mode, double weight, double *out)
{
    for (int64_t first = 0; first < domains->count; first += GROUPS * LANES) {
        lanes F[GROUPS][3][3], C[GROUPS][3][3], V[GROUPS][3][3];
        for (int g = 0; g < GROUPS; ++g) {
            gradients_of(cells, domains, first + g * LANES, x, F[g][0]);
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    C[g][i][j] = F[g][0][i] * F[g][0][j] + F[g][1][i] * F[g][1][j] + F[g][2][i] * F[g][2][j];
        }
        eigensystems(GROUPS, C, V);
        for (int g = 0; g < GROUPS && first + g * LANES < domains->count; ++g)
            slots = add_hessians(cells, domains, density, second, first + g * LANES, F[g], V[g], slots, mode, weight, out);
    }
}

/* Adds weight times the Hessians of domains in 3D to blocks `out` (3 x 3 each), with slots and mode as in elements.c. `density` and `second` are the
 * first and second derivatives of psi by the stretches. */
void isotropic_hessians(const domains_t *domains, const density_t *density, const density_t *second, const double *x, const int32_t *slots, int mode,
                        double weight, double *out)
{
    EACH(domains, isotropic, density, second, x, slots, mode, weight, out);
}

/* For `count` symmetric matrices C = F' F (count, 3, 3): those with the same axes, and 1 / s in place of s^2 along an axis of extension, 1 / s^2 along
 * one of compression. */
void stretch_metrics(int64_t count, const double *C, double *out)
{
    for (int64_t first = 0; first < count; first += LANES) {
        const int used = lanes_used(count, first);
        lanes A[3][3], V[3][3], m[3];
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                for (int l = 0; l < LANES; ++l)
                    A[i][j][l] = l < used ? C[9 * (first + l) + 3 * i + j] : (double)(i == j);
        eigensystems(1, &A, &V);
        for (int q = 0; q < 3; ++q)
            m[q] = all(1.0) / choose(A[q][q] < all(1.0), A[q][q], root(A[q][q]));
        for (int l = 0; l < used; ++l)
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j) {
                    double sum = 0.0;
                    for (int q = 0; q < 3; ++q)
                        sum += V[i][q][l] * m[q][l] * V[j][q][l];
                    out[9 * (first + l) + 3 * i + j] = sum;
                }
    }
}
