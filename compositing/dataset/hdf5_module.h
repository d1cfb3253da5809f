// HDF5 files, through a module that is loaded with the first one.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

namespace glasswing {

// A text or an array in C order. Groups are made for a name such as "Camera/name".
struct Hdf5Dataset {
  std::string name;
  std::variant<std::string, std::vector<double>, std::vector<float>> value;
  std::vector<std::uint64_t> shape = {};  // empty: a single value
};

// What the module exports.
struct Hdf5Module {
  // False: the file cannot be written.
  bool (*write)(const std::string& path, std::span<const Hdf5Dataset> datasets);
};

// UNIMPLEMENTED: the module is not installed.
absl::StatusOr<const Hdf5Module*> hdf5_module();

}  // namespace glasswing
