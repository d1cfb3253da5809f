#include "compositing/deliver/delivery_file.h"

#include <ImathBox.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <OpenEXR/ImfThreading.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfTiledOutputPart.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <half.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <fstream>
#include <mutex>
#include <optional>
#include <thread>

#include "compositing/deliver/cryptomatte.h"
#include "compositing/deliver/half_channels.h"
#include "compositing/deliver/thumbnail.h"
#include "core/base/status.h"
#include "core/matte/matte_file.h"
#include "core/matte/matte_layers.h"
#include "core/radiometry/primary_mix.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr int kStripRows = 128;  // of scan lines, which are packed at once by all threads

// Pixels that show the object.
struct Extent {
  int left = 1 << 30, top = 1 << 30, right = -1, bottom = -1;
  void add(int x, int y) {
    left = std::min(left, x);
    top = std::min(top, y);
    right = std::max(right, x);
    bottom = std::max(bottom, y);
  }
};

// A matte's rows as they are to be written: the preview is in primaries, if those are known.
class Planes {
 public:
  Planes(const MatteOutline& outline, const PrimaryMix& mix)
      : block_(outline.modes_per_channel, outline.colourless, outline.width_px),
        mix_(mix),
        width_px_(outline.width_px) {}

  void take(const Matte& rows) {
    block_.take(rows, 0, rows.height_px());
    if (mix_.is_unit()) return;
    for (int i = 0; i < rows.height_px() * width_px_; ++i) {
      const PrimaryMix::Light light = mix_.primaries({red()[i], green()[i], blue()[i]});
      red()[i] = light[0];
      green()[i] = light[1];
      blue()[i] = light[2];
    }
  }
  std::array<float, 4> preview(int x, int row) const {
    const int i = row * width_px_ + x;
    return {red()[i], green()[i], blue()[i], alpha()[i]};
  }
  const MatteBlock& block() const { return block_; }

 private:
  // In the order of names: A B G R.
  float* alpha() const { return block_.planes(kPreviewPart)[0]; }
  float* blue() const { return block_.planes(kPreviewPart)[1]; }
  float* green() const { return block_.planes(kPreviewPart)[2]; }
  float* red() const { return block_.planes(kPreviewPart)[3]; }

  MatteBlock block_;
  const PrimaryMix& mix_;
  const int width_px_;
};

// What has to be known about all pixels before the first is written.
struct Survey {
  Extent object;
  HalfChannels halves;
  Thumbnail thumbnail;

  explicit Survey(const MatteOutline& outline)
      : halves(matte_parts(outline.modes_per_channel, outline.colourless)),
        thumbnail(outline.width_px, outline.height_px) {}
};

absl::StatusOr<Survey> survey_of(std::string_view matte, const MatteOutline& outline, const PrimaryMix& mix,
                                 int thread_count, absl::FunctionRef<void(double)> report) {
  Survey survey(outline);
  std::mutex mutex;
  int done = 0;
  GW_RETURN_IF_ERROR(for_blocks_of_matte(matte, thread_count, [&](const Matte& rows) {
    Planes planes(outline, mix);
    planes.take(rows);
    Survey seen(outline);
    seen.halves.look(planes.block(), rows.height_px(), rows.width_px());
    const std::lock_guard lock(mutex);
    survey.halves.join(seen.halves);
    const int top = rows.y0_px() - outline.y0_px;
    for (int row = 0; row < rows.height_px(); ++row) {
      for (int x = 0; x < rows.width_px(); ++x) {
        if (rows.coverage(x, row) > 0.0f) survey.object.add(rows.x0_px() + x, rows.y0_px() + row);
        survey.thumbnail.add(x, top + row, planes.preview(x, row));
      }
    }
    report(0.5 * (done += rows.height_px()) / outline.height_px);
    return absl::OkStatus();
  }));
  return survey;
}

// The Color Interop Forum's name for the samples of a part.
const char* colour_of(size_t part, bool primaries_known) {
  if (part >= kFirstModePart) return "data";
  return part == kPreviewPart && primaries_known ? "lin_rec709_scene" : "unknown";
}

std::string half_text(const std::vector<std::string>& layers) {
  return fmt::format(
      "16 bits: {}; each sample of light or of an error is within 2^-11 of itself, so a composite is within "
      "2^-11 of the light that adds up to it; all others are exact. 32 bits: channels that 16 would change "
      "more, such as places and widths",
      fmt::join(layers, ", "));
}

// A file being written, from the top, strip by strip: a row of tiles, or some scan lines.
class StripWriter {
 public:
  StripWriter(const MatteOutline& outline, const DeliveryOptions& options, const ExrWindow& window,
              const Survey& survey, const std::vector<ExrPart>& parts, const std::optional<Cryptomatte>& ids,
              bool primaries_known, const fs::path& path, int threads)
      : options_(options),
        window_(window),
        parts_(parts),
        ids_(ids),
        matte_parts_(parts.size() - (ids ? 1 : 0)),
        matte_width_px_(outline.width_px),
        left_(window.x0_px - outline.x0_px),
        strip_rows_(std::min(options.tile_px > 0 ? options.tile_px : kStripRows, window.height_px)) {
    std::vector<Imf::Header> headers;
    for (size_t part = 0; part < parts.size(); ++part) {
      Imf::Header& header = headers.emplace_back(
          Imath::Box2i({0, 0}, {window.picture_width_px - 1, window.picture_height_px - 1}), data_window());
      header.setName(parts[part].name);
      header.setType(options.tile_px > 0 ? Imf::TILEDIMAGE : Imf::SCANLINEIMAGE);
      header.compression() = Imf::ZIP_COMPRESSION;
      if (options.tile_px > 0) {
        const auto side = static_cast<unsigned>(options.tile_px);
        header.setTileDescription(Imf::TileDescription(side, side, Imf::ONE_LEVEL));
      }
      for (const auto& [name, text] : parts[part].attributes) header.insert(name, Imf::StringAttribute(text));
      header.insert("colorInteropID", Imf::StringAttribute(colour_of(part, primaries_known)));
      if (part == kPreviewPart && primaries_known)
        header.insert("oiio:ColorSpace", Imf::StringAttribute("lin_rec709"));
      std::vector<Channel>& channels = strip_.emplace_back();
      for (size_t c = 0; c < parts[part].channels.size(); ++c) {
        Channel& channel = channels.emplace_back();
        channel.half = options.half && part < matte_parts_ && survey.halves.is_half(part, c);
        header.channels().insert(parts[part].channels[c],
                                 Imf::Channel(channel.half ? Imf::HALF : Imf::FLOAT));
        channel.samples.resize(static_cast<size_t>(strip_rows_) * row_bytes(channel));
      }
    }
    headers.front().setPreviewImage(survey.thumbnail.image());
    stream_.emplace(path.c_str());
    file_.emplace(*stream_, headers.data(), static_cast<int>(headers.size()), false, threads);
    head_bytes_ = stream_->tellp();
  }

  // Writes `rows` rows of a block, from `first_row` of it on; the block may be rounded.
  void put(const MatteBlock& block, int first_row, int rows) {
    for (int row = first_row; row < first_row + rows; ++row) {
      for (size_t part = 0; part < strip_.size(); ++part) {
        for (size_t c = 0; c < strip_[part].size(); ++c) {
          Channel& channel = strip_[part][c];
          char* const to = channel.samples.data() + static_cast<size_t>(held_) * row_bytes(channel);
          if (part >= matte_parts_) {
            const int y = window_.y0_px + written_ + held_;
            std::memcpy(
                to, ids_->planes[c].data() + static_cast<std::ptrdiff_t>(y) * ids_->width_px + window_.x0_px,
                row_bytes(channel));
            continue;
          }
          float* const from =
              block.planes(part)[c] + static_cast<std::ptrdiff_t>(row) * matte_width_px_ + left_;
          if (!channel.half) {
            std::memcpy(to, from, row_bytes(channel));
            continue;
          }
          auto* const halves = reinterpret_cast<Imath::half*>(to);
          for (int x = 0; x < window_.width_px; ++x) from[x] = halves[x] = Imath::half(from[x]);
        }
      }
      if (++held_ == strip_rows_) write_strip();
    }
    for (const std::uint64_t checksum : block.checksums(first_row, rows, left_, window_.width_px))
      checksums_.push_back(checksum);
  }

  std::string finish() {
    if (held_ > 0) write_strip();
    file_.reset();  // writes the table of chunks
    stream_.reset();
    return row_checksums(checksums_);
  }
  // Of headers and tables, at the file's start.
  std::uint64_t head_bytes() const { return head_bytes_; }

 private:
  struct Channel {
    bool half = false;
    std::vector<char> samples;  // of a strip
  };

  Imath::Box2i data_window() const {
    return {{window_.x0_px, window_.y0_px},
            {window_.x0_px + window_.width_px - 1, window_.y0_px + window_.height_px - 1}};
  }
  size_t row_bytes(const Channel& channel) const {
    return static_cast<size_t>(window_.width_px) * (channel.half ? sizeof(Imath::half) : sizeof(float));
  }

  void write_strip() {
    const int top = window_.y0_px + written_;
    const Imath::Box2i pixels({window_.x0_px, top}, {window_.x0_px + window_.width_px - 1, top + held_ - 1});
    for (size_t part = 0; part < strip_.size(); ++part) {
      Imf::FrameBuffer buffer;
      for (size_t c = 0; c < strip_[part].size(); ++c) {
        const Channel& channel = strip_[part][c];
        buffer.insert(parts_[part].channels[c], Imf::Slice::Make(channel.half ? Imf::HALF : Imf::FLOAT,
                                                                 channel.samples.data(), pixels));
      }
      if (options_.tile_px > 0) {
        Imf::TiledOutputPart output(*file_, static_cast<int>(part));
        output.setFrameBuffer(buffer);
        const int row = written_ / options_.tile_px;
        output.writeTiles(0, output.numXTiles() - 1, row, row);
      } else {
        Imf::OutputPart output(*file_, static_cast<int>(part));
        output.setFrameBuffer(buffer);
        output.writePixels(held_);
      }
    }
    written_ += held_;
    held_ = 0;
  }

  const DeliveryOptions& options_;
  const ExrWindow& window_;
  const std::vector<ExrPart>& parts_;  // of the matte, and the ids
  const std::optional<Cryptomatte>& ids_;
  const size_t matte_parts_;
  const int matte_width_px_, left_, strip_rows_;
  int held_ = 0, written_ = 0;  // rows of the strip, and of the file
  std::vector<std::vector<Channel>> strip_;
  std::vector<std::uint64_t> checksums_;
  std::uint64_t head_bytes_ = 0;
  std::optional<Imf::StdOFStream> stream_;
  std::optional<Imf::MultiPartOutputFile> file_;
};

// Writes the checksums, which are only known at the end, into their reserved places in the headers.
absl::Status put_checksums(const fs::path& path, std::uint64_t head_bytes, const std::string& rows,
                           const std::string& all) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  std::string head(head_bytes, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  put_attribute(head, kMatteRows, rows);
  put_attribute(head, kMatteChecksum, all);
  file.seekp(0);
  file.write(head.data(), static_cast<std::streamsize>(head.size()));
  if (file.flush()) return absl::OkStatus();
  return absl::UnavailableError(fmt::format("cannot write {}", path.string()));
}

ExrWindow window_of(const MatteOutline& outline, const DeliveryOptions& options, const Extent& object) {
  ExrWindow window = window_of(outline);
  if (!options.hug) return window;
  window.x0_px = object.left;
  window.y0_px = object.top;
  window.width_px = object.right - object.left + 1;
  window.height_px = object.bottom - object.top + 1;
  return window;
}

// The edits of the matte itself, for its list of edits; empty: none.
std::string edit_of(const DeliveryOptions& options, const Delivery& delivery) {
  std::vector<std::string> words;
  if (options.hug) words.emplace_back("hug");
  if (!delivery.half_layers.empty()) words.emplace_back("half");
  return words.empty() ? "" : fmt::format("deliver {}", fmt::join(words, " "));
}

absl::StatusOr<std::optional<Cryptomatte>> ids_of(const DeliveryOptions& options,
                                                  const v1::MatteMetadata& matte) {
  if (options.ids.empty()) return std::nullopt;
  GW_ASSIGN_OR_RETURN(Cryptomatte ids, read_cryptomatte(options.ids));
  if (ids.width_px == matte.width_px() && ids.height_px == matte.height_px()) return ids;
  return absl::InvalidArgumentError(fmt::format("{} has a picture of {}x{} px, the matte one of {}x{}",
                                                options.ids.string(), ids.width_px, ids.height_px,
                                                matte.width_px(), matte.height_px()));
}

// A matte's parts, without those of the ids.
std::vector<ExrPart> described_parts(const MatteOutline& outline, const std::string& metadata,
                                     const DeliveryOptions& options, const Delivery& delivery) {
  std::vector<ExrPart> parts = matte_parts(outline.modes_per_channel, outline.colourless);
  describe(parts, metadata,
           std::string(static_cast<size_t>(delivery.window.height_px) * kRowChecksumDigits, '-'));
  for (ExrPart& part : parts) {
    part.attributes[kMatteDelivery] = fmt::format(
        "a matte for other programs; {}, {}", options.hug ? "its data window hugs the object" : "all pixels",
        options.tile_px > 0 ? fmt::format("tiles of {} px", options.tile_px) : "scan lines");
    if (!delivery.half_layers.empty()) part.attributes["glasswing:half"] = half_text(delivery.half_layers);
  }
  return parts;
}

// Writes the rows of a matte that are in the window. `make_writer` opens the file. Returns the rows'
// checksums, and the size of the file's head.
struct WrittenRows {
  std::string checksums;
  std::uint64_t head_bytes = 0;
};
template <typename MakeWriter>
absl::StatusOr<WrittenRows> write_rows(std::string_view matte, const MatteOutline& outline,
                                       const ExrWindow& window, const PrimaryMix& mix,
                                       const MakeWriter& make_writer,
                                       absl::FunctionRef<void(double)> report) {
  WrittenRows written;
  absl::Status status;
  status.Update(written_exr([&] {
                  StripWriter writer = make_writer();
                  Planes planes(outline, mix);
                  int done = 0;
                  status = for_rows_of_matte(matte, [&](const Matte& block) {
                    return written_exr([&] {
                             const int top = std::max(window.y0_px - block.y0_px(), 0);
                             const int bottom =
                                 std::min(window.y0_px + window.height_px - block.y0_px(), block.height_px());
                             if (bottom > top) {
                               planes.take(block);
                               writer.put(planes.block(), top, bottom - top);
                             }
                             report(0.5 + 0.5 * (done += block.height_px()) / outline.height_px);
                             return std::string();
                           })
                        .status();
                  });
                  if (status.ok()) {
                    written.head_bytes = writer.head_bytes();
                    written.checksums = writer.finish();
                  }
                  return std::string();
                }).status());
  if (!status.ok()) return status;
  return written;
}

}  // namespace

absl::StatusOr<Delivery> write_delivery(std::string_view matte, const DeliveryOptions& options,
                                        const fs::path& file, int thread_count,
                                        absl::FunctionRef<void(double)> report) {
  if (options.tile_px != 0 && (options.tile_px < kMinTile_px || options.tile_px > kMaxTile_px))
    return absl::InvalidArgumentError(fmt::format("a tile's side is {} px; it must be {} to {}",
                                                  options.tile_px, kMinTile_px, kMaxTile_px));
  if (thread_count <= 0) thread_count = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  GW_ASSIGN_OR_RETURN(MatteOutline outline, outline_of(matte));
  if (outline.pyramids) outline.metadata.clear_footprint();
  GW_ASSIGN_OR_RETURN(const PrimaryMix mix, PrimaryMix::create(outline.metadata));
  GW_ASSIGN_OR_RETURN(const Survey survey, survey_of(matte, outline, mix, thread_count, report));
  if (options.hug && survey.object.right < 0)
    return absl::InvalidArgumentError("no pixel shows the object, which the data window is to hug");
  GW_ASSIGN_OR_RETURN(const std::optional<Cryptomatte> ids, ids_of(options, outline.metadata));
  Delivery delivery;
  delivery.window = window_of(outline, options, survey.object);
  if (options.half) delivery.half_layers = survey.halves.layers();
  if (const std::string edit = edit_of(options, delivery); !edit.empty()) outline.metadata.add_edits(edit);

  const std::string metadata = json_of(outline.metadata);
  const std::vector<ExrPart> parts = described_parts(outline, metadata, options, delivery);
  std::vector<ExrPart> all_parts = parts;
  if (ids) {
    all_parts.push_back({.name = kIdsPart, .channels = ids->channels, .attributes = {}});
    // Programs look for these in the first part, whichever has the layers.
    for (ExrPart& part : all_parts) part.attributes.insert(ids->attributes.begin(), ids->attributes.end());
  }
  const int threads_before = Imf::globalThreadCount();
  Imf::setGlobalThreadCount(thread_count);
  const absl::StatusOr<WrittenRows> rows = write_rows(
      matte, outline, delivery.window, mix,
      [&] {
        return StripWriter(outline, options, delivery.window, survey, all_parts, ids, !mix.is_unit(), file,
                           thread_count);
      },
      report);
  Imf::setGlobalThreadCount(threads_before);
  GW_RETURN_IF_ERROR(rows.status());
  GW_RETURN_IF_ERROR(put_checksums(file, rows->head_bytes, rows->checksums,
                                   matte_checksum(metadata, parts, rows->checksums)));
  std::error_code ignored;
  delivery.bytes = fs::file_size(file, ignored);
  return delivery;
}

}  // namespace glasswing
