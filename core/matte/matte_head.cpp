#include "core/matte/matte_head.h"

#include <ImathBox.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/matte/matte_layers.h"

namespace glasswing {
namespace {

bool is_colourless(const Imf::MultiPartInputFile& file) {
  return file.header(kFirstModePart).channels().findChannel(colourless_channel()) != nullptr;
}

// Of deflate: 258 bytes from two bits.
constexpr size_t kMaxExpansion = 1032;
// A file may describe a blank picture around its pixels, which takes memory but no bytes: 4 GB decoded.
constexpr size_t kLeastFile_bytes = 4 << 20;

bool is_delivery(const Imf::MultiPartInputFile& file) {
  return file.header(0).findTypedAttribute<Imf::StringAttribute>(kMatteDelivery) != nullptr;
}

// Parts that hold the matte: in a delivery file, object ids may follow them.
int matte_part_count(const Imf::MultiPartInputFile& file) {
  const int parts = file.parts();
  const Imf::Header& last = file.header(parts - 1);
  return is_delivery(file) && last.hasName() && last.name() == kIdsPart ? parts - 1 : parts;
}

bool has_pyramids(const Imf::MultiPartInputFile& file) {
  const Imf::Header& last = file.header(matte_part_count(file) - 1);
  return last.hasName() && last.name() == kPyramidPart;
}

int mode_count(const Imf::MultiPartInputFile& file) {
  return matte_part_count(file) - static_cast<int>(kFirstModePart) - (has_pyramids(file) ? 1 : 0);
}

// Whether a part is packed like a matte, or as delivery files may be.
bool is_well_packed(const Imf::Header& header, bool delivery) {
  if (!header.hasType()) return false;
  const Imf::Compression compression = header.compression();
  if (!delivery) return header.type() == Imf::SCANLINEIMAGE && compression == Imf::ZIPS_COMPRESSION;
  const bool tiled = header.type() == Imf::TILEDIMAGE;
  return (tiled ? header.hasTileDescription() : header.type() == Imf::SCANLINEIMAGE) &&
         (compression == Imf::ZIPS_COMPRESSION || compression == Imf::ZIP_COMPRESSION);
}

struct Parts {
  std::vector<ExrPart> parts;
  size_t layer_count = 0;
};

// Checks that the file has the parts of a matte, and no more pixels than `file_bytes` can hold, so that later
// reads are bounded by the file's size, whatever its header promises.
absl::StatusOr<Parts> checked_parts(const Imf::MultiPartInputFile& file, size_t file_bytes) {
  const int part_count = matte_part_count(file), modes = mode_count(file);
  if (modes < 1 || modes > kMaxModes) return absl::DataLossError("it does not have the parts of a matte");
  const Imath::Box2i& window = file.header(0).dataWindow();
  constexpr int kMaxSide = kMaxSide_px;
  if (window.isEmpty() || window.min.x < 0 || window.min.y < 0 || window.max.x >= kMaxSide ||
      window.max.y >= kMaxSide) {
    return absl::DataLossError("its size is out of range");
  }
  const bool delivery = is_delivery(file);
  size_t pixel_bytes = 0;
  Parts checked{.parts = matte_parts(modes, is_colourless(file), has_pyramids(file))};
  for (int i = 0; i < file.parts(); ++i) {
    const Imf::Header& header = file.header(i);
    if (header.dataWindow() != window) return absl::DataLossError("its parts differ in size");
    std::vector<std::string> layers;
    bool plain = is_well_packed(header, delivery);
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
      layers.emplace_back(channel.name());
      const Imf::PixelType type = channel.channel().type;
      plain = plain && (type == Imf::FLOAT || (delivery && type == Imf::HALF)) &&
              channel.channel().xSampling == 1 && channel.channel().ySampling == 1;
      pixel_bytes += type == Imf::HALF ? 2 : sizeof(float);
    }
    if (plain && i >= part_count) continue;
    const ExrPart& part = checked.parts[std::min(i, part_count - 1)];
    if (!plain || layers != part.channels || !header.hasName() || header.name() != part.name)
      return absl::DataLossError(fmt::format("its part {} does not have the layers of a matte", i));
    checked.layer_count += layers.size();
  }
  const size_t pixels =
      static_cast<size_t>(window.max.x - window.min.x + 1) * (window.max.y - window.min.y + 1);
  if (pixels * pixel_bytes / kMaxExpansion > file_bytes)
    return absl::DataLossError("it is too short for its size");
  return checked;
}

absl::Status check_metadata(const v1::MatteMetadata& metadata, const Imath::Box2i& window) {
  if (metadata.format_version() > 1) {
    return absl::FailedPreconditionError(
        fmt::format("its format_version is {}; this program reads 1", metadata.format_version()));
  }
  const int width = metadata.width_px(), height = metadata.height_px();
  if (width < 1 || height < 1 || width > kMaxSide_px || height > kMaxSide_px || window.max.x >= width ||
      window.max.y >= height) {
    return absl::DataLossError(fmt::format("it has a picture of {}x{} px, but has pixels up to ({}, {})",
                                           width, height, window.max.x, window.max.y));
  }
  if (metadata.monitors_size() > kMaxMonitors) {
    return absl::DataLossError(fmt::format("it names {} monitors; at most {} are supported",
                                           metadata.monitors_size(), kMaxMonitors));
  }
  const std::string& footprint = metadata.footprint();
  if (!footprint.empty() && footprint != "gaussian" && footprint != kBoxFootprint &&
      footprint != kPyramidFootprint) {
    return absl::FailedPreconditionError(fmt::format(
        "its footprints are \"{}\"; this program reads \"gaussian\", \"box\" and \"pyramid\"", footprint));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> text_of(const Imf::Header& header, const char* attribute) {
  const auto* text = header.findTypedAttribute<Imf::StringAttribute>(attribute);
  if (text == nullptr)
    return absl::DataLossError(fmt::format("it is not a Glasswing matte: it has no {}", attribute));
  return text->value();
}

}  // namespace

absl::StatusOr<MatteHead> read_matte_head(const Imf::MultiPartInputFile& file, size_t file_bytes) {
  GW_ASSIGN_OR_RETURN(const Parts checked, checked_parts(file, file_bytes));
  const Imf::Header& header = file.header(0);
  const Imath::Box2i& window = header.dataWindow();
  MatteHead head;
  MatteOutline& outline = head.outline;
  outline.x0_px = window.min.x;
  outline.y0_px = window.min.y;
  outline.width_px = window.max.x - window.min.x + 1;
  outline.height_px = window.max.y - window.min.y + 1;
  outline.modes_per_channel = mode_count(file);
  outline.colourless = is_colourless(file);
  outline.delivery = is_delivery(file);
  outline.pyramids = has_pyramids(file);
  GW_ASSIGN_OR_RETURN(const std::string metadata, text_of(header, kMatteMetadata));
  GW_ASSIGN_OR_RETURN(head.row_checksums, text_of(header, kMatteRows));
  GW_ASSIGN_OR_RETURN(const std::string checksum, text_of(header, kMatteChecksum));
  if (matte_checksum(metadata, checked.parts, head.row_checksums) != checksum ||
      head.row_checksums.size() != static_cast<size_t>(outline.height_px) * kRowChecksumDigits)
    return absl::DataLossError("its checksum does not match its headers");
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  if (!google::protobuf::util::JsonStringToMessage(metadata, &outline.metadata, options).ok())
    return absl::DataLossError("its metadata cannot be read");
  GW_RETURN_IF_ERROR(check_metadata(outline.metadata, window));
  if (outline.pyramids != (outline.metadata.footprint() == kPyramidFootprint))
    return absl::DataLossError("its metadata and its parts disagree about pyramids");
  if (!outline.delivery) return head;
  outline.x0_px = outline.y0_px = 0;
  outline.width_px = outline.metadata.width_px();
  outline.height_px = outline.metadata.height_px();
  const size_t pixels = static_cast<size_t>(outline.width_px) * outline.height_px;
  if (pixels * checked.layer_count * sizeof(float) / kMaxExpansion > std::max(file_bytes, kLeastFile_bytes))
    return absl::DataLossError("it is too short for its picture");
  return head;
}

}  // namespace glasswing
