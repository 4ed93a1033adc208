/* A large program: every operation is a loop over rows, which the workers share, with a wait behind it.

   One circuit alone is computed with neighbouring rows side by side in a vector, a batch with neighbouring members. */

#include <sched.h>

#define CK_SIMD_WIDTH 8

#if defined(__x86_64__) || defined(__i386__)
#define CK_PAUSE() __builtin_ia32_pause()
#else
#define CK_PAUSE() (void)0
#endif
#define CK_SPINS 2000

/* Until all workers are here. */
static __attribute__((noinline)) void wait_for_all(ck_context *c, int64_t workers)
{
    ck_barrier *barrier = c->barrier;
    if (workers == 1) return;
    int round = atomic_load_explicit(&barrier->round, memory_order_relaxed);
    if (atomic_fetch_add_explicit(&barrier->arrived, 1, memory_order_acq_rel) == workers - 1) {
        atomic_store_explicit(&barrier->arrived, 0, memory_order_relaxed);
        atomic_store_explicit(&barrier->round, round + 1, memory_order_release);
        return;
    }
    for (int spins = 0; atomic_load_explicit(&barrier->round, memory_order_acquire) == round; spins++) {
        CK_PAUSE();
        if (spins > CK_SPINS) sched_yield();
    }
}

/* A worker's part of n, in whole vectors. */
CK_INLINE int64_t part(int64_t n, int64_t worker, int64_t workers)
{
    return worker == workers ? n : n * worker / workers & -(int64_t)CK_SIMD_WIDTH;
}

/* A worker's part of rows, with as many terms as the others have. */
CK_INLINE int64_t part_by_terms(const int64_t *indptr, int64_t n, int64_t worker, int64_t workers)
{
    int64_t wanted = indptr[0] + (indptr[n] - indptr[0]) * worker / workers, low = 0, high = n;
    if (worker == 0 || worker == workers) return worker ? n : 0;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (indptr[middle] < wanted) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* Numbers that are read once a step need not drive those out of the cache that are read again and again. */
CK_INLINE void expect(const real *weights, const int32_t *sources, int n_weights, int64_t k, int64_t n)
{
    const int64_t ahead = 256, line = 64;
    for (int64_t i = 0; i < n && n_weights; i += line / sizeof(real)) __builtin_prefetch(weights + k + ahead + i, 0, 0);
    for (int64_t i = 0; i < n; i += line / sizeof(int32_t)) __builtin_prefetch(sources + k + ahead + i, 0, 0);
}

/* `n_weights` says which there are: 0 one for all terms, 1 one for every term, 2 one for every term and member; `degree`
   how many terms every sum has, if not -1; `is_long` whether the weights do not fit into the cache. */
CK_INLINE void sum_alone(real *restrict rows, const real *restrict sources_from, int64_t n,
    const int64_t *restrict indptr, const int32_t *restrict sources, const real *restrict weights, int n_weights,
    int add, int64_t degree, int is_long, int64_t stride, int64_t worker, int64_t workers)
{
    int64_t end = part_by_terms(indptr, n, worker + 1, workers);
    (void)stride;
    for (int64_t i = part_by_terms(indptr, n, worker, workers); i < end; i++) {
        int64_t k = degree >= 0 ? indptr[0] + i * degree : indptr[i], stop = degree >= 0 ? k + degree : indptr[i + 1];
        real sum = add ? rows[i] : 0;
        if (is_long) expect(weights, sources, n_weights, k, stop - k);
        if (degree >= 0 && degree <= 32) {
#pragma GCC unroll 32
            for (int64_t d = 0; d < degree; d++) sum += weights[n_weights ? k + d : 0] * sources_from[sources[k + d]];
        } else {
            for (; k < stop; k++) sum += weights[n_weights ? k : 0] * sources_from[sources[k]];
        }
        rows[i] = sum;
    }
}

CK_INLINE void sum_batch(real *restrict rows, const real *restrict sources_from, int64_t n, const int64_t *restrict indptr,
    const int32_t *restrict sources, const real *restrict weights, int n_weights, int add, int64_t stride,
    int64_t worker, int64_t workers)
{
    int64_t end = part_by_terms(indptr, n, worker + 1, workers);
    for (int64_t i = part_by_terms(indptr, n, worker, workers); i < end; i++) {
        for (int64_t at = 0; at < stride; at += CK_SIMD_WIDTH) {
            v_8 sum = add ? load_8(rows + i * stride + at) : all_8(0);
            for (int64_t k = indptr[i]; k < indptr[i + 1]; k++) {
                v_8 weight = n_weights == 2 ? load_8(weights + k * stride + at) : all_8(weights[n_weights ? k : 0]);
                sum = sum + weight * load_8(sources_from + sources[k] * stride + at);
            }
            store_8(rows + i * stride + at, sum);
        }
    }
}

/* Recalls or remembers neighbours, which share their age. */
CK_INLINE void copy(real *restrict to, const real *restrict from, int64_t n, int64_t stride, int64_t worker, int64_t workers)
{
    int64_t begin = part(n, worker, workers), end = part(n, worker + 1, workers);
    memcpy(to + begin * stride, from + begin * stride, (end - begin) * stride * sizeof(real));
}

static __attribute__((unused)) void recall(real *restrict rows, const real *restrict ring, int64_t n, const int32_t *slots,
    const int32_t *steps, int64_t n_slots, int64_t place, int64_t depth, int64_t stride, int64_t worker, int64_t workers)
{
    int64_t end = part(n, worker + 1, workers);
    for (int64_t i = part(n, worker, workers); i < end; i++) {
        const real *from = ring + (ck_ago(place, steps[i], depth) * n_slots + slots[i]) * stride;
        if (stride == 1) rows[i] = *from;
        else memcpy(rows + i * stride, from, stride * sizeof(real));
    }
}

static __attribute__((unused)) void remember(const real *restrict table, real *restrict ring, int64_t n, const int32_t *sources,
    int64_t place, int64_t stride, int64_t worker, int64_t workers)
{
    int64_t end = part(n, worker + 1, workers);
    for (int64_t i = part(n, worker, workers); i < end; i++) {
        real *to = ring + (place * n + i) * stride;
        if (stride == 1) *to = table[sources[i]];
        else memcpy(to, table + sources[i] * stride, stride * sizeof(real));
    }
}

static __attribute__((unused)) void add_noise(real *restrict rows, int64_t n, const real *scale, int n_scales, const int32_t *streams,
    const uint64_t *seeds, int64_t time, int64_t stride, int64_t worker, int64_t workers)
{
    int64_t end = part(n, worker + 1, workers);
    for (int64_t i = part(n, worker, workers); i < end; i++) {
        for (int64_t b = 0; b < stride; b++) {
            real sigma = scale[n_scales == 2 ? i * stride + b : n_scales ? i : 0];
            rows[i * stride + b] += sigma * normal_1(seeds + b, streams[i], time);
        }
    }
}

/* Whether numbers side by side are all finite. */
CK_INLINE int are_finite(const real *from, int64_t n)
{
    v_8 sum = all_8(0), sum2 = all_8(0);
    real rest = 0;
    int64_t i = 0;
    for (; i + 16 <= n; i += 16) {
        sum = sum + load_8(from + i);
        sum2 = sum2 + load_8(from + i + 8);
    }
    for (; i < n; i++) rest += from[i];
    return ck_is_finite(total_8(sum + sum2) + rest);
}
