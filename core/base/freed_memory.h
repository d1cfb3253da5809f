// For programs that make and drop large planes many times a second.
#pragma once

#include <malloc.h>

namespace glasswing {

// Freed memory, up to a GiB, stays with the process: fetching pages anew, zeroed, takes longer than filling
// them. Call it first in main().
inline void keep_freed_memory() {
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the most that glibc takes
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
}

}  // namespace glasswing
