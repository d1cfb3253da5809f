// The formats of `glasswing dataset` (docs/dataset.md). A writer gets one view after the other.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "compositing/dataset/dataset_view.h"

namespace glasswing {

struct DatasetOptions {
  std::filesystem::path directory;
  int channel = 1;
  // The object in front of a picture, for viewing.
  std::function<absl::StatusOr<RadianceImage>(const Matte& matte)> picture;
};

class DatasetWriter {
 public:
  virtual ~DatasetWriter() = default;
  virtual absl::Status add(const DatasetView& view) = 0;
  virtual absl::Status finish() = 0;
};

// A row of the table of formats.
struct DatasetFormat {
  const char* name;
  const char* help;
  bool needs_geometry;  // and the poses of the object
  std::unique_ptr<DatasetWriter> (*create)(const DatasetOptions& options);
};
const std::vector<DatasetFormat>& dataset_formats();

std::unique_ptr<DatasetWriter> transport_writer(const DatasetOptions& options);
std::unique_ptr<DatasetWriter> idr_writer(const DatasetOptions& options);
std::unique_ptr<DatasetWriter> neto_writer(const DatasetOptions& options);
std::unique_ptr<DatasetWriter> transforms_writer(const DatasetOptions& options);
std::unique_ptr<DatasetWriter> colmap_writer(const DatasetOptions& options);
std::unique_ptr<DatasetWriter> sofast_writer(const DatasetOptions& options);

}  // namespace glasswing
