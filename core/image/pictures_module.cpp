#include <opencv2/imgcodecs.hpp>

#include "core/image/picture_codecs.h"

extern "C" const glasswing::PictureCodecs glasswing_picture_codecs;
const glasswing::PictureCodecs glasswing_picture_codecs{
    .decode = [](const cv::Mat& bytes, int flags) { return cv::imdecode(bytes, flags); },
    .encode = [](const std::string& suffix, const cv::Mat& picture, std::vector<unsigned char>& bytes,
                 const std::vector<int>& options) { return cv::imencode(suffix, picture, bytes, options); }};
