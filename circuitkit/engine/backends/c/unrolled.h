/* Steps of a small program: members run through all steps of a job, CK_WIDTH or CK_NARROW side by side, before the
   next ones begin.

   The generated source before it has the sizes N_INPUTS, N_KEPT and N_MEMORIES, `kept_rows`, and `step` (of a batch also
   `step_narrow`), which does a control step and says whether the inputs and all rows that last are finite. */

/* Looks again, at the real members alone; the filling is set to the last of them. */
static int is_finite(const ck_context *c, real *table, int64_t members, int64_t width)
{
    for (int64_t k = 0; k < N_KEPT; k++) {
        real *row = table + kept_rows[k] * c->stride;
        for (int64_t lane = 0; lane < members; lane++)
            if (!isfinite(row[lane])) return 0;
        for (int64_t lane = members; lane < width; lane++) row[lane] = row[members - 1];
    }
    return 1;
}

CK_INLINE void record(const ck_context *c, const real *table, const ck_job *job, double *to, int64_t members)
{
    for (int64_t lane = 0; lane < members; lane++)
        for (int64_t i = 0; i < job->n_rows; i++) *to++ = table[job->rows[i] * c->stride + lane];
}

#if CK_WIDTH == 1

/* Rows stand in variables, not in memory, while a run lasts. */
int64_t ck_work(ck_context *c, const ck_job *job, int64_t worker, int64_t workers)
{
    real *table = c->table, rows[N_ROWS], given[N_INPUTS + 1];
    int64_t places[N_MEMORIES + 1];
    const int is_usual = job->n_rows == N_USUAL && !memcmp(job->rows, usual_rows, N_USUAL * sizeof *usual_rows);
    double *to = job->record;
    (void)worker, (void)workers;
    begin_memories(places, c->done);
    if (job->steps == 1 && !job->inputs && !job->n_rows)
        return step(c, table, 1, table + 1, 1, 0, places, c->time + c->done) || is_finite(c, table, 1, 1);
    copy_rows(rows, table);
    for (int64_t t = 0; t < job->steps; t++) {
        for (int64_t i = 0; i < N_INPUTS; i++) given[i] = job->inputs ? job->inputs[t * N_INPUTS + i] : table[1 + i];
        const int is_good = step(c, rows, 1, given, 1, 0, places, c->time + c->done + t);
        if (is_usual) record_usual(to + t * N_USUAL, rows);
        if (is_good && (is_usual || !job->n_rows) && t + 1 < job->steps) continue;
        copy_rows(table, rows);
        for (int64_t i = 0; i < N_INPUTS; i++) table[1 + i] = given[i];
        if (!is_usual) record(c, table, job, to + t * job->n_rows, 1);
        if (!is_good && !is_finite(c, table, 1, 1)) return t;
    }
    return job->steps;
}

#else

CK_INLINE void read_inputs(real *given, const double *from, int64_t members, const int64_t width)
{
    for (int64_t lane = 0; lane < width; lane++)
        for (int64_t i = 0; i < N_INPUTS; i++)
            given[i * width + lane] = (real)from[(lane < members ? lane : members - 1) * N_INPUTS + i];
}

/* All steps of `width` members from `at`. */
CK_INLINE int64_t run_members(const ck_context *c, const ck_job *job, int64_t at, const int64_t width)
{
    real *table = (real *)c->table + at, given[(N_INPUTS + 1) * CK_WIDTH];
    const int64_t stride = c->stride, members = c->batch - at < width ? c->batch - at : width;
    int64_t places[N_MEMORIES + 1];
    begin_memories(places, c->done);
    for (int64_t t = 0; t < job->steps; t++) {
        if (job->inputs) {
            read_inputs(given, job->inputs + (t * c->batch + at) * N_INPUTS, members, width);
            for (int64_t i = 0; i < N_INPUTS; i++)
                memcpy(table + (1 + i) * stride, given + i * width, sizeof(real) * width);
        }
        const int is_good = (width == CK_WIDTH ? step : step_narrow)(
            c, table, stride, table + stride, stride, at, places, c->time + c->done + t);
        record(c, table, job, job->record + (t * c->batch + at) * job->n_rows, members);
        if (!is_good && !is_finite(c, table, members, width)) return t;
    }
    return job->steps;
}

int64_t ck_work(ck_context *c, const ck_job *job, int64_t worker, int64_t workers)
{
    const int64_t vectors = (c->batch + CK_NARROW - 1) / CK_NARROW;
    const int64_t end = vectors * (worker + 1) / workers * CK_NARROW;
    int64_t first_bad = job->steps, at = vectors * worker / workers * CK_NARROW;
    while (at < end) {
        const int is_wide = end - at >= CK_WIDTH;
        const int64_t bad = is_wide ? run_members(c, job, at, CK_WIDTH) : run_members(c, job, at, CK_NARROW);
        if (bad < first_bad) first_bad = bad;
        at += is_wide ? CK_WIDTH : CK_NARROW;
    }
    return first_bad;
}

#endif
