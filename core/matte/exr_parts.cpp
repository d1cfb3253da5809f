#include "core/matte/exr_parts.h"

#include <ImathBox.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfMultiPartOutputFile.h>
#include <OpenEXR/ImfOutputPart.h>
#include <OpenEXR/ImfPartType.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace glasswing {
namespace {

class MemoryWriter final : public Imf::OStream {
 public:
  MemoryWriter() : OStream("matte") {}
  void write(const char c[], int n) override {
    const auto size = static_cast<size_t>(n);
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

}  // namespace

absl::StatusOr<std::string> encode_exr(const std::vector<ExrPart>& parts, const Matte& matte,
                                       const std::map<std::string, std::string>& attributes, int zip_level) {
  try {
    const int right = matte.x0_px() + matte.width_px(), bottom = matte.y0_px() + matte.height_px();
    const Imath::Box2i pixels({matte.x0_px(), matte.y0_px()}, {right - 1, bottom - 1});
    const Imath::Box2i picture({0, 0}, {std::max(matte.metadata.width_px(), right) - 1,
                                        std::max(matte.metadata.height_px(), bottom) - 1});
    std::vector<Imf::Header> headers;
    for (const ExrPart& part : parts) {
      Imf::Header& header = headers.emplace_back(picture, pixels);
      header.compression() = Imf::ZIP_COMPRESSION;
      header.zipCompressionLevel() = zip_level;
      header.setType(Imf::SCANLINEIMAGE);
      header.setName(part.name);
      for (const auto& [name, text] : attributes) header.insert(name, Imf::StringAttribute(text));
      for (const ExrPlane& plane : part.planes)
        header.channels().insert(plane.name, Imf::Channel(Imf::FLOAT));
    }
    MemoryWriter writer;
    {
      Imf::MultiPartOutputFile file(writer, headers.data(), static_cast<int>(headers.size()));
      for (size_t i = 0; i < parts.size(); ++i) {
        Imf::FrameBuffer buffer;
        for (const ExrPlane& plane : parts[i].planes) {
          buffer.insert(plane.name, Imf::Slice::Make(Imf::FLOAT, plane.values.data(), pixels));
        }
        Imf::OutputPart part(file, static_cast<int>(i));
        part.setFrameBuffer(buffer);
        part.writePixels(matte.height_px());
      }
    }
    return std::move(writer.bytes);
  } catch (const std::exception& error) {
    return absl::InternalError(fmt::format("the OpenEXR file cannot be written: {}", error.what()));
  }
}

}  // namespace glasswing
