// For programs that allocate and free large blocks many times a second.
#pragma once

#include <malloc.h>

namespace glasswing {

// kPlanes: a solver's planes, on many threads. Blocks up to 32 MiB come from the heap; a larger one, such as
// a whole stack of frames, goes back to the system at once. kPictures: a node's pictures, of whatever size:
// one thread allocates what another one frees, so there is one arena, and blocks up to 1 GiB come from it.
enum class LargeBlocks { kPlanes, kPictures };

// Up to 1 GiB of freed memory stays with the process, because faulting zeroed pages in again takes longer
// than filling them. Call it first in main().
inline void keep_freed_memory(LargeBlocks blocks = LargeBlocks::kPlanes) {
  ::mallopt(M_MMAP_THRESHOLD, blocks == LargeBlocks::kPlanes ? 32 << 20 : 1 << 30);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
  if (blocks == LargeBlocks::kPictures) ::mallopt(M_ARENA_MAX, 1);
}

}  // namespace glasswing
