#include "core/image/picture_codecs.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/process/module.h"

namespace glasswing {
namespace {

absl::StatusOr<const PictureCodecs*> picture_codecs() {
  static const absl::StatusOr<const void*> kModule =
      load_module("glasswing-pictures.so", "glasswing_picture_codecs");
  GW_RETURN_IF_ERROR(kModule.status());
  return static_cast<const PictureCodecs*>(*kModule);
}

}  // namespace

absl::StatusOr<cv::Mat> decode_picture(std::string_view bytes, int flags) {
  GW_ASSIGN_OR_RETURN(const PictureCodecs* codecs, picture_codecs());
  try {
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    cv::Mat picture = codecs->decode(raw, flags);
    if (picture.empty()) return absl::DataLossError("it is damaged, or not a picture");
    return picture;
  } catch (const cv::Exception& error) {
    return absl::DataLossError(fmt::format("it cannot be decoded: {}", error.err));
  }
}

absl::StatusOr<std::string> encode_picture(const std::string& suffix, const cv::Mat& picture,
                                           const std::vector<int>& options) {
  GW_ASSIGN_OR_RETURN(const PictureCodecs* codecs, picture_codecs());
  try {
    std::vector<unsigned char> bytes;
    if (codecs->encode(suffix, picture, bytes, options)) return std::string(bytes.begin(), bytes.end());
    return absl::InternalError("the picture cannot be encoded");
  } catch (const cv::Exception& error) {
    return absl::InternalError(fmt::format("the picture cannot be encoded: {}", error.err));
  }
}

}  // namespace glasswing
