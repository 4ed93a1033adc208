/* Sums of which few sources are not zero, as of spikes: only what those send is added.

   A term of zero changes no sum, and the columns of a matrix are gone through in the order in which every row has its
   terms: so all bits are those of the sums over all terms. */

#define CK_FEW 4 /* of so many sources one may be active if their columns are added, and not all rows: measured */

/* Which of n numbers are not zero. A worker lists its part's in ascending order, from where the part begins, and says in
   `counts` how many they are. */
static __attribute__((unused, noinline)) void find_active(const real *restrict from, int64_t n, int32_t *restrict active,
    int64_t *restrict counts, int64_t worker, int64_t workers)
{
    enum { ABREAST = 4 * CK_SIMD_WIDTH };
    int64_t i = part(n, worker, workers), end = part(n, worker + 1, workers), count = 0;
    active += i;
    while (i < end) {
        int64_t stop = end;
        if (i + ABREAST <= end) {
            w_8 some = bits_8(load_8(from + i)) | bits_8(load_8(from + i + 8)) | bits_8(load_8(from + i + 16)) |
                       bits_8(load_8(from + i + 24));
            whole any = 0;
            for (int lane = 0; lane < CK_SIMD_WIDTH; lane++) any |= some[lane];
            stop = i + ABREAST;
            if (!any) i = stop;
        }
        for (; i < stop; i++) {
            active[count] = (int32_t)i;
            count += from[i] != 0;
        }
    }
    counts[worker] = count;
}

/* Whether at most one in `CK_FEW` of n is not zero. */
CK_INLINE int are_few(const int64_t *counts, int64_t n, int64_t workers)
{
    int64_t all = 0;
    for (int64_t worker = 0; worker < workers; worker++) all += counts[worker];
    return all * CK_FEW <= n;
}

/* The first place from `k` on, up to `stop`, of a target that is not before `first`. */
CK_INLINE int64_t from_target(const int32_t *targets, int64_t k, int64_t stop, int64_t first)
{
    while (k < stop) {
        int64_t middle = (k + stop) / 2;
        if (targets[middle] < first) k = middle + 1;
        else stop = middle;
    }
    return k;
}

/* Every worker adds to its part of the rows, of whose sources there are `n_sources`. `begins` says where each one's
   targets begin; the rest is as in `sum_alone`. */
CK_INLINE void sum_active(real *restrict rows, const real *restrict from, int64_t n, int64_t n_sources,
    const int32_t *restrict active, const int64_t *restrict counts, const int64_t *restrict begins,
    const int32_t *restrict targets, const real *restrict weights, int n_weights, int add, int64_t worker, int64_t workers)
{
    const int64_t ahead = 16, /* columns stand anywhere, so that they must be asked for in time */
                  line = 64 / sizeof(int32_t);
    int64_t first = part(n, worker, workers), end = part(n, worker + 1, workers);
    if (!add) memset(rows + first, 0, (end - first) * sizeof(real));
    for (int64_t finder = 0; finder < workers; finder++) {
        const int32_t *sources = active + part(n_sources, finder, workers);
        for (int64_t i = 0; i < counts[finder]; i++) {
            int64_t k = begins[sources[i]], stop = begins[sources[i] + 1];
            const real x = from[sources[i]];
            if (i + 2 * ahead < counts[finder]) __builtin_prefetch(begins + sources[i + 2 * ahead], 0, 3);
            if (i + ahead < counts[finder]) {
                int64_t next = begins[sources[i + ahead]], last = begins[sources[i + ahead] + 1];
                for (int64_t t = next; t < last; t += line) {
                    __builtin_prefetch(targets + t, 0, 0);
                    if (n_weights) __builtin_prefetch(weights + t, 0, 0);
                    if (n_weights) __builtin_prefetch(weights + t + line / 2, 0, 0);
                }
            }
            if (workers > 1) {
                k = from_target(targets, k, stop, first);
                stop = from_target(targets, k, stop, end);
            }
            for (; k < stop; k++) rows[targets[k]] += weights[n_weights ? k : 0] * x;
        }
    }
}
