// How a program retains freed memory. Call one of these first in main().
#pragma once

#include <malloc.h>

namespace glasswing {

// kPlanes: a solver's planes, on many threads. Blocks up to 32 MiB come from the heap; a larger one, such as
// a whole stack of frames, goes back to the system at once. kPictures: a node's pictures, of whatever size:
// one thread allocates what another one frees, so there is one arena, and blocks up to 1 GiB come from it.
enum class LargeBlocks { kPlanes, kPictures };

// For programs that allocate and free large blocks many times a second. Up to 1 GiB of freed memory stays
// with the process, because faulting zeroed pages in again takes longer than filling them.
inline void keep_freed_memory(LargeBlocks blocks = LargeBlocks::kPlanes) {
  ::mallopt(M_MMAP_THRESHOLD, blocks == LargeBlocks::kPlanes ? 32 << 20 : 1 << 30);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
  if (blocks == LargeBlocks::kPictures) ::mallopt(M_ARENA_MAX, 1);
}

// For programs that hold data sent by peers, so that the memory of a short peak is not kept forever. One
// arena, since each of several would keep its own peak.
inline void return_freed_memory() {
  ::mallopt(M_MMAP_THRESHOLD, 256 << 10);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 20);
  ::mallopt(M_ARENA_MAX, 1);
}

}  // namespace glasswing
