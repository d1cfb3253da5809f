// The interface of a fuzz target, a reader of untrusted bytes. One source per reader defines both functions;
// it is linked with libFuzzer (libfuzzer.cpp) or with a small driver that mutates the seeds (driver.cpp).
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing::fuzz {

// Inputs to start from: valid ones, and those that mutation would not find because of a checksum.
std::vector<std::string> seeds();

// Reads `input`; aborts the process unless the result is a value that keeps the reader's guarantees, or an
// error with a message.
void try_input(std::string_view input);

// An empty directory of this process in TMPDIR, removed at exit.
const std::filesystem::path& scratch_directory();

void write_plainly(const std::filesystem::path& path, std::string_view bytes);

}  // namespace glasswing::fuzz

// Checks a guarantee of the reader; unlike assert, in every build.
#define FUZZ_CHECK(condition)                                                              \
  do {                                                                                     \
    if (!(condition)) {                                                                    \
      std::fprintf(stderr, "%s:%d: broken promise: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                        \
    }                                                                                      \
  } while (false)
