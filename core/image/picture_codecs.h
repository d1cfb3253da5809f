// PNG, JPEG, TIFF and other pictures through OpenCV. Its codecs link GDAL and a hundred more libraries, which
// take 0.2 s of processor time to load, so they are in a separate module that is loaded with the first
// picture.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace glasswing {

// What the module exports.
struct PictureCodecs {
  cv::Mat (*decode)(const cv::Mat& bytes, int flags);
  bool (*encode)(const std::string& suffix, const cv::Mat& picture, std::vector<unsigned char>& bytes,
                 const std::vector<int>& options);
};

// `flags` are cv::imdecode's. DATA_LOSS: damaged, or not a picture. UNIMPLEMENTED: the module is not
// installed. OpenCV allocates what a header promises, so check the size first.
absl::StatusOr<cv::Mat> decode_picture(std::string_view bytes, int flags);
// `suffix` (".png") and `options` are cv::imencode's. INTERNAL: it cannot be encoded. UNIMPLEMENTED as above.
absl::StatusOr<std::string> encode_picture(const std::string& suffix, const cv::Mat& picture,
                                           const std::vector<int>& options = {});

}  // namespace glasswing
