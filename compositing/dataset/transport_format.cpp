// SciPy's sparse matrices (scipy.sparse.load_npz), a folder for each view.
#include <fmt/format.h>

#include <array>
#include <limits>
#include <nlohmann/json.hpp>

#include "compositing/dataset/dataset_format.h"
#include "compositing/dataset/npz.h"
#include "core/base/status.h"
#include "core/cli/progress.h"
#include "core/file/file.h"
#include "core/footprint/matte_transport.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// `values`: those of the matrix or their errors.
absl::Status write_sparse(const fs::path& path, const TransportMatrix& matrix,
                          const std::vector<float>& values) {
  GW_ASSIGN_OR_RETURN(NpzWriter file, NpzWriter::create(path));
  const std::int64_t entries = std::ssize(matrix.columns);
  // SciPy converts indices of different types to the wider one.
  if (entries <= std::numeric_limits<std::int32_t>::max()) {
    const std::vector<std::int32_t> starts(matrix.starts.begin(), matrix.starts.end());
    GW_RETURN_IF_ERROR(file.add("indices", numpy_array(std::span(matrix.columns), {entries})));
    GW_RETURN_IF_ERROR(file.add("indptr", numpy_array(std::span(starts), {std::ssize(starts)})));
  } else {
    const std::vector<std::int64_t> columns(matrix.columns.begin(), matrix.columns.end());
    GW_RETURN_IF_ERROR(file.add("indices", numpy_array(std::span(columns), {entries})));
    GW_RETURN_IF_ERROR(
        file.add("indptr", numpy_array(std::span(matrix.starts), {std::ssize(matrix.starts)})));
  }
  GW_RETURN_IF_ERROR(file.add("format", numpy_text("csr")));
  const std::array<std::int64_t, 2> shape{matrix.row_count, matrix.column_count};
  GW_RETURN_IF_ERROR(file.add("shape", numpy_array(std::span(shape), {2})));
  GW_RETURN_IF_ERROR(file.add("data", numpy_array(std::span(values), {entries})));
  return file.finish();
}

// Of a linear map of three primaries or channels, row by row.
template <typename Map>
std::vector<std::array<float, kChannels>> rows_of(const Map& map) {
  std::vector<std::array<float, kChannels>> rows(kChannels);
  for (int column = 0; column < kChannels; ++column) {
    PrimaryMix::Light unit{};
    unit[column] = 1.0f;
    const PrimaryMix::Light image = map(unit);
    for (int row = 0; row < kChannels; ++row) rows[row][column] = image[row];
  }
  return rows;
}

nlohmann::ordered_json description_of(const Matte& matte, const MatteTransport& transport,
                                      const PrimaryMix& mix) {
  nlohmann::ordered_json monitors = nlohmann::ordered_json::array();
  for (int t = 0; t < matte.metadata.monitors_size(); ++t) {
    const v1::Monitor& monitor = matte.metadata.monitors(t);
    monitors.push_back({{"name", monitor.name()},
                        {"width_px", monitor.width_px()},
                        {"height_px", monitor.height_px()},
                        {"first_column", transport.first_column(t)}});
    monitors.back()["primaries_to_channels"] =
        rows_of([&](const PrimaryMix::Light& light) { return mix.is_unit() ? light : mix.seen(t, light); });
  }
  return {{"session", matte.metadata.session()},
          {"method", matte.metadata.method()},
          {"width_px", matte.width_px()},
          {"height_px", matte.height_px()},
          {"monitors", monitors},
          {"channels_to_primaries", rows_of([&](const PrimaryMix::Light& light) {
             return mix.is_unit() ? light : mix.primaries(light);
           })},
          {"left_out", MatteTransport::kLeftOut},
          {"errors", transport.has_covariance() ? "covariance of all modes" : "weights and centres"},
          {"warnings",
           std::vector<std::string>(matte.metadata.warnings().begin(), matte.metadata.warnings().end())}};
}

// What the matrix does not contain.
absl::Status write_pixels(const fs::path& directory, const Matte& matte) {
  std::vector<float> foreground, coverage;
  std::vector<std::uint8_t> flags;
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      for (int c = 0; c < kChannels; ++c) foreground.push_back(matte.foreground_of_gaussians(x, y, c));
      coverage.push_back(matte.coverage(x, y));
      flags.push_back(matte.flags(x, y));
    }
  }
  const std::int64_t height = matte.height_px(), width = matte.width_px();
  GW_RETURN_IF_ERROR(write_npy(directory / "foreground.npy",
                               numpy_array(std::span(foreground), {height, width, kChannels})));
  GW_RETURN_IF_ERROR(
      write_npy(directory / "coverage.npy", numpy_array(std::span(coverage), {height, width})));
  return write_npy(directory / "flags.npy", numpy_array(std::span(flags), {height, width}));
}

class TransportWriter final : public DatasetWriter {
 public:
  explicit TransportWriter(fs::path directory) : directory_(std::move(directory)) {}
  absl::Status add(const DatasetView& view) override {
    const fs::path own = directory_ / view.name;
    GW_RETURN_IF_ERROR(make_directory_durably(own));
    GW_ASSIGN_OR_RETURN(const MatteTransport transport, MatteTransport::create(view.matte));
    GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(view.matte.metadata));
    for (int c = 0; c < kChannels; ++c) {
      Progress progress(fmt::format("{}, channel {}", view.name, kChannelNames[c]));
      GW_ASSIGN_OR_RETURN(const TransportMatrix matrix,
                          transport.matrix(c, true, 0, [&](double done) { progress.update(done); }));
      GW_RETURN_IF_ERROR(write_sparse(own / fmt::format("{}.npz", kChannelNames[c]), matrix, matrix.values));
      if (matrix.errors.size() == matrix.values.size())
        GW_RETURN_IF_ERROR(
            write_sparse(own / fmt::format("{}_sd.npz", kChannelNames[c]), matrix, matrix.errors));
    }
    GW_RETURN_IF_ERROR(write_pixels(own, view.matte));
    return write_file_durably(own / "transport.json",
                              description_of(view.matte, transport, mix).dump(1) + "\n");
  }
  absl::Status finish() override { return absl::OkStatus(); }

 private:
  fs::path directory_;
};

}  // namespace

std::unique_ptr<DatasetWriter> transport_writer(const DatasetOptions& options) {
  return std::make_unique<TransportWriter>(options.directory);
}

}  // namespace glasswing
