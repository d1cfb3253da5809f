// Measures the duration of a job store's calls, and counts those without an answer.
#pragma once

#include <memory>

#include "server/jobs/job_store.h"

namespace glasswing {

// Passes every call to `store`. glasswing_job_store_seconds contains the durations by operation, without
// wait_for_tiles; glasswing_job_store_failures_total counts calls that failed with UNAVAILABLE, and
// `problems` reports this until one is answered.
std::unique_ptr<JobStore> timed(std::unique_ptr<JobStore> store, Problems& problems);

}  // namespace glasswing
