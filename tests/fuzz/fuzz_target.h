// A reader of untrusted bytes, as fuzzing sees it. One source a reader defines both functions; it is linked
// with libFuzzer (libfuzzer.cpp), or with a small driver that mutates the seeds (driver.cpp).
#pragma once

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing::fuzz {

// Inputs to start from: good ones, and such as a checksum would keep mutation from finding.
std::vector<std::string> seeds();

// Reads `input`; ends the process if what comes of it is neither a value that keeps the reader's promises
// nor an error with words.
void try_input(std::string_view input);

// An empty directory of this process, in TMPDIR, removed at its end.
const std::filesystem::path& scratch_directory();

void write_plainly(const std::filesystem::path& path, std::string_view bytes);

}  // namespace glasswing::fuzz

// A promise of the reader's. Unlike assert it holds in every build.
#define FUZZ_CHECK(condition)                                                              \
  do {                                                                                     \
    if (!(condition)) {                                                                    \
      std::fprintf(stderr, "%s:%d: broken promise: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                                        \
    }                                                                                      \
  } while (false)
