#include "tests/fuzz/fuzz_target.h"

#include <unistd.h>

#include <fstream>

namespace glasswing::fuzz {
namespace {

namespace fs = std::filesystem;

class Scratch {
 public:
  Scratch() : path_(fs::temp_directory_path() / ("glasswing-fuzz." + std::to_string(::getpid()))) {
    fs::create_directories(path_);
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }

 private:
  const fs::path path_;
};

}  // namespace

const fs::path& scratch_directory() {
  static const Scratch scratch;
  return scratch.path();
}

void write_plainly(const fs::path& path, std::string_view bytes) {
  std::error_code ignored;
  fs::remove(path, ignored);  // some file systems flush a file that is truncated and rewritten
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace glasswing::fuzz
