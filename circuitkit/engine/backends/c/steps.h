/* The control steps of a large program; the generated source before it has N_INPUTS, N_KEPT, N_MEMORIES, pairs of first
   and last rows `kept` that last, and `step`. */

static int kept_are_finite(const ck_context *c, int64_t worker, int64_t workers)
{
    const real *table = c->table;
    for (int64_t k = 0; k < N_KEPT; k++) {
        int64_t n = kept[k][1] - kept[k][0];
        int64_t begin = part(n, worker, workers), end = part(n, worker + 1, workers);
        if (!are_finite(table + (kept[k][0] + begin) * c->stride, (end - begin) * c->stride)) return 0;
    }
    return 1;
}

/* Looks again, at the real members alone; the filling is set to the last of them. */
static int members_are_finite(const ck_context *c)
{
    real *table = c->table;
    for (int64_t k = 0; k < N_KEPT; k++) {
        for (int64_t i = kept[k][0]; i < kept[k][1]; i++) {
            real *row = table + i * c->stride;
            for (int64_t b = 0; b < c->batch; b++)
                if (!isfinite(row[b])) return 0;
            for (int64_t b = c->batch; b < c->stride; b++) row[b] = row[c->batch - 1];
        }
    }
    return 1;
}

static void read_inputs(const ck_context *c, const double *from)
{
    real *table = c->table;
    for (int64_t i = 0; i < N_INPUTS; i++)
        for (int64_t b = 0; b < c->batch; b++) table[(1 + i) * c->stride + b] = (real)from[b * N_INPUTS + i];
}

static void record(const ck_context *c, const ck_job *job, int64_t t, int64_t worker, int64_t workers)
{
    const real *table = c->table;
    int64_t end = part(job->n_rows, worker + 1, workers);
    for (int64_t b = 0; b < c->batch; b++) {
        double *to = job->record + (t * c->batch + b) * job->n_rows;
        for (int64_t i = part(job->n_rows, worker, workers); i < end; i++) to[i] = table[job->rows[i] * c->stride + b];
    }
}

int64_t ck_work(ck_context *c, const ck_job *job, int64_t worker, int64_t workers)
{
    int64_t places[N_MEMORIES + 1];
    begin_memories(places, c->done);
    for (int64_t t = 0; t < job->steps; t++) {
        if (job->inputs) {
            if (worker == 0) read_inputs(c, job->inputs + t * c->batch * N_INPUTS);
            wait_for_all(c, workers);
        }
        step(c, places, c->time + c->done + t, worker, workers);
        if (!kept_are_finite(c, worker, workers)) atomic_store(&c->suspect, 1);
        record(c, job, t, worker, workers);
        wait_for_all(c, workers);
        if (atomic_load(&c->suspect)) {
            wait_for_all(c, workers);
            if (worker == 0) atomic_store(&c->suspect, !members_are_finite(c));
            wait_for_all(c, workers);
            if (atomic_load(&c->suspect)) return t;
        }
    }
    return job->steps;
}
