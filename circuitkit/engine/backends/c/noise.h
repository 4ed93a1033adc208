/* Normal numbers by counting, as `engine/noise.py` defines them; in double precision whatever the program's is. */

CK_INLINE uint64_t ck_mix(uint64_t z)
{
    z = (z ^ (z >> 30)) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ (z >> 27)) * UINT64_C(0x94D049BB133111EB);
    return z ^ (z >> 31);
}

static double ck_normal(uint64_t seed, int32_t stream, int64_t time)
{
    const uint64_t gamma = UINT64_C(0x9E3779B97F4A7C15);
    uint64_t a = ck_mix(ck_mix(seed + gamma) ^ (uint64_t)(int64_t)stream * UINT64_C(0xD1342543DE82EF95));
    uint64_t b = ck_mix(a + (uint64_t)(time + 1) * gamma);
    uint64_t c = ck_mix(b ^ UINT64_C(0xD6E8FEB86659FD93));
    double u = (double)((b >> 11) + 1) * 0x1p-53, v = (double)(c >> 11) * 0x1p-53;
    return sqrt(-2.0 * log(u)) * cos(v * 6.283185307179586);
}

CK_INLINE real normal_1(const uint64_t *seeds, int32_t stream, int64_t time)
{
    return (real)ck_normal(*seeds, stream, time);
}

CK_INLINE v_8 normal_8(const uint64_t *seeds, int32_t stream, int64_t time)
{
    v_8 y;
    for (int lane = 0; lane < 8; lane++) y[lane] = normal_1(seeds + lane, stream, time);
    return y;
}
