/* Steps of a small program: members run through all steps of a job, CK_WIDTH side by side, before the next ones begin.

   The generated source before it has the sizes N_INPUTS, N_KEPT and N_MEMORIES, `kept_rows`, and `step`, which does a
   control step and says whether the inputs and all rows that last are finite. */

/* Looks again, at the real members alone; the filling is set to the last of them. */
static int is_finite(const ck_context *c, real *table, int64_t members)
{
    for (int64_t k = 0; k < N_KEPT; k++) {
        real *row = table + kept_rows[k] * c->stride;
        for (int64_t lane = 0; lane < members; lane++)
            if (!isfinite(row[lane])) return 0;
        for (int64_t lane = members; lane < CK_WIDTH; lane++) row[lane] = row[members - 1];
    }
    return 1;
}

CK_INLINE void read_inputs(real *table, int64_t stride, const double *from, int64_t members)
{
    for (int64_t lane = 0; lane < members; lane++)
        for (int64_t i = 0; i < N_INPUTS; i++) table[(1 + i) * stride + lane] = (real)from[lane * N_INPUTS + i];
}

CK_INLINE void record(const real *table, int64_t stride, const ck_job *job, int64_t first_member, int64_t members)
{
    double *to = job->record + first_member * job->n_rows;
    for (int64_t lane = 0; lane < members; lane++)
        for (int64_t i = 0; i < job->n_rows; i++) *to++ = table[job->rows[i] * stride + lane];
}

/* All steps of the members from `at`. */
CK_INLINE int64_t run_members(const ck_context *c, const ck_job *job, int64_t at)
{
    real *table = (real *)c->table + at;
    int64_t stride = CK_WIDTH == 1 ? 1 : c->stride, batch = CK_WIDTH == 1 ? 1 : c->batch;
    int64_t members = batch - at < CK_WIDTH ? batch - at : CK_WIDTH;
    int64_t places[N_MEMORIES + 1];
    begin_memories(places, c->done);
    for (int64_t t = 0; t < job->steps; t++) {
        if (job->inputs) read_inputs(table, stride, job->inputs + (t * batch + at) * N_INPUTS, members);
        if (!step(c, table, stride, at, places, c->time + c->done + t) && !is_finite(c, table, members)) {
            record(table, stride, job, t * batch + at, members);
            return t;
        }
        record(table, stride, job, t * batch + at, members);
    }
    return job->steps;
}

int64_t ck_work(ck_context *c, const ck_job *job, int64_t worker, int64_t workers)
{
    int64_t groups = (c->batch + CK_WIDTH - 1) / CK_WIDTH, first_bad = job->steps;
    if (CK_WIDTH == 1) return run_members(c, job, 0);
    for (int64_t group = groups * worker / workers; group < groups * (worker + 1) / workers; group++) {
        int64_t bad = run_members(c, job, group * CK_WIDTH);
        if (bad < first_bad) first_bad = bad;
    }
    return first_bad;
}
