// NumPy's files: .npy holds an array, .npz a ZIP archive of them (numpy.lib.format, version 1.0; not
// compressed, ZIP64).
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/cli/output_file.h"
#include "core/file/file.h"

namespace glasswing {

// An array in C order; `type` is NumPy's, such as "<f4".
struct NumpyArray {
  std::string type;
  std::vector<std::int64_t> shape;  // empty: a single value
  std::string_view bytes;
};
NumpyArray numpy_array(std::span<const float> values, std::vector<std::int64_t> shape);
NumpyArray numpy_array(std::span<const double> values, std::vector<std::int64_t> shape);
NumpyArray numpy_array(std::span<const std::int32_t> values, std::vector<std::int64_t> shape);
NumpyArray numpy_array(std::span<const std::int64_t> values, std::vector<std::int64_t> shape);
NumpyArray numpy_array(std::span<const std::uint8_t> values, std::vector<std::int64_t> shape);
// A single value of type S.
NumpyArray numpy_text(std::string_view text);

std::string npy_header(const NumpyArray& array);
absl::Status write_npy(const std::filesystem::path& path, const NumpyArray& array);

class NpzWriter {
 public:
  static absl::StatusOr<NpzWriter> create(const std::filesystem::path& path);
  // `name`: of the array, without ".npy".
  absl::Status add(const std::string& name, const NumpyArray& array);
  // The file has its name once this returns OK.
  absl::Status finish();

 private:
  NpzWriter(std::filesystem::path path, FileWriter file) : path_(std::move(path)), file_(std::move(file)) {}
  struct Entry {
    std::string name;
    std::uint64_t offset, size;
    std::uint32_t checksum;
  };
  std::filesystem::path path_;
  FileWriter file_;  // beside it
  std::uint64_t written_ = 0;
  std::vector<Entry> entries_;
};

}  // namespace glasswing
