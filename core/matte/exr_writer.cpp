#include "core/matte/exr_writer.h"

#include <ImathBox.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStdIO.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>

namespace glasswing {
namespace {

// The fastest level: mattes are one percent larger than at 4, the default of OpenEXR.
constexpr int kZipLevel = 1;

class MemoryWriter final : public Imf::OStream {
 public:
  MemoryWriter() : OStream("matte") {}
  void write(const char c[], int n) override {
    const size_t size = n;
    if (bytes.size() < at_ + size) bytes.resize(at_ + size);
    std::memcpy(&bytes[at_], c, size);
    at_ += size;
  }
  uint64_t tellp() override { return at_; }
  void seekp(uint64_t position) override { at_ = position; }
  std::string bytes;

 private:
  size_t at_ = 0;
};

std::vector<Imf::Header> headers_of(const std::vector<ExrPart>& parts, const ExrWindow& window) {
  const int right = window.x0_px + window.width_px, bottom = window.y0_px + window.height_px;
  const Imath::Box2i pixels({window.x0_px, window.y0_px}, {right - 1, bottom - 1});
  const Imath::Box2i picture(
      {0, 0}, {std::max(window.picture_width_px, right) - 1, std::max(window.picture_height_px, bottom) - 1});
  std::vector<Imf::Header> headers;
  for (const ExrPart& part : parts) {
    Imf::Header& header = headers.emplace_back(picture, pixels);
    header.compression() = Imf::ZIPS_COMPRESSION;
    header.zipCompressionLevel() = kZipLevel;
    header.setType(Imf::SCANLINEIMAGE);
    header.setName(part.name);
    for (const auto& [name, text] : part.attributes) header.insert(name, Imf::StringAttribute(text));
    for (const std::string& channel : part.channels)
      header.channels().insert(channel, Imf::Channel(Imf::FLOAT));
  }
  return headers;
}

}  // namespace

class ExrWriter::File {
 public:
  File(const std::vector<ExrPart>& parts, const ExrWindow& window,
       const std::optional<std::filesystem::path>& path)
      : parts_(parts), window_(window), next_(parts.size(), 0) {
    const std::vector<Imf::Header> headers = headers_of(parts, window);
    if (path) stream_.emplace(path->c_str());
    Imf::OStream& out = stream_ ? static_cast<Imf::OStream&>(*stream_) : memory_;
    file_.emplace(out, headers.data(), static_cast<int>(headers.size()));
  }

  void put(size_t index, std::span<const float* const> channels) {
    const ExrPart& part = parts_.at(index);
    const int y = window_.y0_px + next_[index]++;
    const Imath::Box2i pixels({window_.x0_px, y}, {window_.x0_px + window_.width_px - 1, y});
    Imf::FrameBuffer buffer;
    for (size_t c = 0; c < part.channels.size(); ++c)
      buffer.insert(part.channels[c], Imf::Slice::Make(Imf::FLOAT, channels[c], pixels));
    Imf::OutputPart output(*file_, static_cast<int>(index));
    output.setFrameBuffer(buffer);
    output.writePixels(1);
  }

  std::string finish() {
    file_.reset();  // writes the table of chunks
    return std::move(memory_.bytes);
  }

 private:
  const std::vector<ExrPart> parts_;
  const ExrWindow window_;
  std::vector<int> next_;  // next row of each part, from the window's first
  MemoryWriter memory_;
  std::optional<Imf::StdOFStream> stream_;
  std::optional<Imf::MultiPartOutputFile> file_;
};

ExrWindow window_of(const Matte& matte) {
  return {.x0_px = matte.x0_px(),
          .y0_px = matte.y0_px(),
          .width_px = matte.width_px(),
          .height_px = matte.height_px(),
          .picture_width_px = matte.metadata.width_px(),
          .picture_height_px = matte.metadata.height_px()};
}
ExrWindow window_of(const MatteOutline& outline) {
  return {.x0_px = outline.x0_px,
          .y0_px = outline.y0_px,
          .width_px = outline.width_px,
          .height_px = outline.height_px,
          .picture_width_px = outline.metadata.width_px(),
          .picture_height_px = outline.metadata.height_px()};
}

ExrWriter::ExrWriter(const std::vector<ExrPart>& parts, const ExrWindow& window,
                     const std::optional<std::filesystem::path>& path)
    : file_(std::make_unique<File>(parts, window, path)) {}
ExrWriter::~ExrWriter() = default;

void ExrWriter::put(size_t part, std::span<const float* const> channels) {
  file_->put(part, channels);
}

std::string ExrWriter::finish() {
  return file_->finish();
}

absl::StatusOr<std::string> written_exr(absl::FunctionRef<std::string()> write) {
  try {
    return write();
  } catch (const std::exception& error) {
    return absl::InternalError(fmt::format("the OpenEXR file cannot be written: {}", error.what()));
  }
}

}  // namespace glasswing
