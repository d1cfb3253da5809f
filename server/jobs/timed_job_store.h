// A job store that tells monitoring how long each of its calls takes, and how often it does not answer.
#pragma once

#include <memory>

#include "server/jobs/job_store.h"

namespace glasswing {

// Every call goes to `store` and comes back as it is; glasswing_job_store_seconds has its time by operation,
// but for wait_for_tiles, and glasswing_job_store_failures_total counts those that were not answered.
std::unique_ptr<JobStore> timed(std::unique_ptr<JobStore> store);

}  // namespace glasswing
