// Feeds a reader its seeds and many mutations of them. Deterministic: uses neither clock nor entropy.
//
//   fuzz.NAME [--runs N]        the short run of the tests
//   fuzz.NAME --seeds DIRECTORY writes the seeds, for libFuzzer to start from
//   fuzz.NAME FILE...           reads these inputs, such as those that libFuzzer saved on a failure
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <new>
#include <random>

#include "tests/fuzz/fuzz_target.h"

// Small inputs must not make readers allocate much memory.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
void* operator new(std::size_t size) {
  constexpr std::size_t kMax = 256u << 20;
  if (size > kMax) {
    std::fprintf(stderr, "%zu bytes allocated at once\n", size);
    std::abort();
  }
  void* memory = std::malloc(size > 0 ? size : 1);
  if (memory == nullptr) std::abort();
  return memory;
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}
#endif

namespace glasswing::fuzz {
namespace {

constexpr size_t kLongest = 1u << 16;

// Values that often break readers of numbers and paths.
constexpr std::array<std::string_view, 28> kTokens{"0",
                                                   "-1",
                                                   "1",
                                                   "-0",
                                                   "255",
                                                   "65535",
                                                   "65536",
                                                   "16384",
                                                   "16385",
                                                   "2147483647",
                                                   "2147483648",
                                                   "-2147483649",
                                                   "4294967296",
                                                   "9223372036854775807",
                                                   "18446744073709551616",
                                                   "1e308",
                                                   "1e999",
                                                   "-1e999",
                                                   "\"NaN\"",
                                                   "\"Infinity\"",
                                                   "null",
                                                   "true",
                                                   "[]",
                                                   "{}",
                                                   "\"\"",
                                                   "../",
                                                   "\xff",
                                                   "\n"};

class Mutator {
 public:
  explicit Mutator(std::vector<std::string> seeds) : seeds_(std::move(seeds)) {}

  std::string next() {
    std::string input = any_seed();
    const size_t count = 1 + below(4);
    for (size_t i = 0; i < count; ++i) mutate(input);
    if (input.size() > kLongest) input.resize(kLongest);
    return input;
  }

 private:
  size_t below(size_t end) { return end == 0 ? 0 : random_() % end; }
  const std::string& any_seed() { return seeds_[below(seeds_.size())]; }

  void mutate(std::string& input) {
    const size_t at = below(input.size() + 1);
    const size_t length = below(std::min<size_t>(input.size() - at, 64) + 1);
    switch (below(9)) {
      case 0:
        if (at < input.size()) input[at] = static_cast<char>(input[at] ^ (1 << below(8)));
        break;
      case 1:
        if (at < input.size()) input[at] = static_cast<char>(below(256));
        break;
      case 2:
        input.erase(at, length);
        break;
      case 3:
        input.insert(at, input.substr(at, length));
        break;
      case 4: {
        const std::string& other = any_seed();
        const size_t from = below(other.size() + 1);
        input.insert(at, other, from, below(256));
        break;
      }
      case 5:
        input.insert(at, kTokens[below(kTokens.size())]);
        break;
      case 6: {  // a number's digits
        const size_t first = input.find_first_of("0123456789", at);
        if (first == std::string::npos) break;
        const size_t last = std::min(input.find_first_not_of("0123456789.e-", first), input.size());
        input.replace(first, last - first, kTokens[below(kTokens.size())]);
        break;
      }
      case 7: {  // a binary number's bytes
        constexpr std::array<std::uint32_t, 6> kWords{0, 1, 0x7fffffff, 0x80000000, 0xffffffff, 0x4000};
        const std::uint32_t word = kWords[below(kWords.size())];
        if (at + 4 <= input.size()) std::memcpy(&input[at], &word, 4);
        break;
      }
      default:
        input.resize(at);
    }
  }

  std::mt19937 random_{1};
  const std::vector<std::string> seeds_;
};

std::string in_hand;

// Saves the input on a crash, to a file that this program can read again.
void leave_input(int signal) {
  constexpr std::string_view kName = "fuzz-found", kWords = "the input is in ./fuzz-found\n";
  const int file = ::open(kName.data(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file >= 0 && ::write(file, in_hand.data(), in_hand.size()) >= 0)
    (void)!::write(STDERR_FILENO, kWords.data(), kWords.size());
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

int main_of(int argc, char** argv) {
  size_t runs = 20000;
  if (argc == 3 && std::strcmp(argv[1], "--seeds") == 0) {
    int number = 0;
    for (const std::string& seed : seeds())
      write_plainly(std::filesystem::path(argv[2]) / ("seed-" + std::to_string(number++)), seed);
    return 0;
  }
  if (argc == 3 && std::strcmp(argv[1], "--runs") == 0) {
    runs = std::strtoul(argv[2], nullptr, 10);
  } else if (argc > 1) {
    for (int i = 1; i < argc; ++i) {
      std::ifstream file(argv[i], std::ios::binary);
      const std::string input{std::istreambuf_iterator<char>(file), {}};
      std::printf("%s: %zu bytes\n", argv[i], input.size());
      try_input(input);
    }
    return 0;
  }
  for (const std::string& seed : seeds()) try_input(seed);
  Mutator mutator(seeds());
  for (const int signal : {SIGABRT, SIGBUS, SIGFPE, SIGSEGV}) std::signal(signal, leave_input);
  for (size_t i = 0; i < runs; ++i) {
    in_hand = mutator.next();
    try_input(in_hand);
  }
  std::printf("%zu inputs read\n", runs);
  return 0;
}

}  // namespace
}  // namespace glasswing::fuzz

int main(int argc, char** argv) {
  return glasswing::fuzz::main_of(argc, argv);
}
