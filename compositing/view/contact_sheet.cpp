#include "compositing/view/contact_sheet.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/image/picture_codecs.h"

namespace glasswing {
namespace {

constexpr int kPanel_px = 440;     // approximate longer side of a panel
constexpr int kMinPanel_px = 300;  // room for a title
constexpr int kMargin = 28, kGap = 28, kTitle = 24, kLegend = 58, kHeading = 40, kLine = 20;
constexpr int kLargeText = 22, kText = 14, kSmallText = 12;
constexpr int kFiner = 4;  // supersampling of letters
const cv::Scalar kInk(40, 32, 28), kPaleInk(110, 102, 98), kFrame(170, 170, 170);

cv::Mat mat_of(const CodeImage& image) {
  cv::Mat mat(image.height_px, image.width_px, CV_8UC3);
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      for (int c = 0; c < 3; ++c) mat.at<cv::Vec3b>(y, x)[2 - c] = image.at(x, y, c);
    }
  }
  return mat;
}

struct Lettering {
  double scale;
  int thickness;
};
Lettering lettering(int size_px) {
  const int thickness = std::max(1, size_px * kFiner / 11);
  return {cv::getFontScaleFromHeight(cv::FONT_HERSHEY_SIMPLEX, size_px * kFiner * 3 / 4, thickness),
          thickness};
}

int text_width(const std::string& text, int size_px) {
  const Lettering letters = lettering(size_px);
  int below = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, letters.scale, letters.thickness, &below).width /
             kFiner +
         1;
}

std::string cut_to(std::string text, int size_px, int width_px) {
  if (text_width(text, size_px) <= width_px) return text;
  while (!text.empty() && text_width(text + "...", size_px) > width_px) text.pop_back();
  return text + "...";
}

// `at`: where the baseline starts.
void write_text(cv::Mat& sheet, const std::string& text, cv::Point at, int size_px, const cv::Scalar& ink) {
  const Lettering letters = lettering(size_px);
  const cv::Rect box = cv::Rect(at.x - 2, at.y - 2 * size_px, text_width(text, size_px) + 6, 3 * size_px) &
                       cv::Rect({}, sheet.size());
  if (box.empty()) return;
  cv::Mat large(box.height * kFiner, box.width * kFiner, CV_8UC1, cv::Scalar(0));
  cv::putText(large, text, (at - box.tl()) * kFiner, cv::FONT_HERSHEY_SIMPLEX, letters.scale, cv::Scalar(255),
              letters.thickness, cv::LINE_AA);
  cv::Mat cover;
  cv::resize(large, cover, box.size(), 0.0, 0.0, cv::INTER_AREA);
  for (int y = 0; y < box.height; ++y) {
    for (int x = 0; x < box.width; ++x) {
      cv::Vec3b& pixel = sheet.at<cv::Vec3b>(box.y + y, box.x + x);
      const double share = cover.at<uchar>(y, x) / 255.0;
      for (int c = 0; c < 3; ++c)
        pixel[c] = cv::saturate_cast<uchar>((1.0 - share) * pixel[c] + share * ink[c]);
    }
  }
}

void place(cv::Mat& sheet, const CodeImage& image, const cv::Rect& box) {
  const bool smaller = box.width < image.width_px;
  cv::Mat fitted;
  cv::resize(mat_of(image), fitted, box.size(), 0.0, 0.0, smaller ? cv::INTER_AREA : cv::INTER_NEAREST);
  fitted.copyTo(sheet(box));
  cv::rectangle(sheet, cv::Rect(box.x - 1, box.y - 1, box.width + 2, box.height + 2), kFrame);
}

void draw_bar(cv::Mat& sheet, const ColourBar& bar, const cv::Rect& room) {
  const cv::Rect box(room.x, room.y, room.width, 14);
  place(sheet, bar.colours, box);
  int free_from = room.x - kMargin;
  for (const ColourBar::Tick& tick : bar.ticks) {
    const int x = box.x + static_cast<int>(std::lround(tick.place * (box.width - 1)));
    const int width = text_width(tick.label, kSmallText);
    const int left = std::clamp(x - width / 2, room.x, room.x + room.width - width);
    if (left < free_from) continue;
    cv::line(sheet, {x, box.y + box.height}, {x, box.y + box.height + 4}, kFrame);
    write_text(sheet, tick.label, {left, box.y + box.height + 18}, kSmallText, kInk);
    free_from = left + width + 8;
  }
}

// Draws as many keys as there is room for, in lines.
void draw_keys(cv::Mat& sheet, const std::vector<PanelKey>& keys, const cv::Rect& room) {
  const bool charts =
      std::ranges::any_of(keys, [](const PanelKey& key) { return key.colours.height_px > 1; });
  const int height = charts ? room.height - 8 : 12, line = charts ? room.height : kLine;
  int x = room.x, y = room.y;
  for (const PanelKey& key : keys) {
    const int width = height * key.colours.width_px / key.colours.height_px;
    const int whole = width + 6 + text_width(key.name, kSmallText);
    if (x > room.x && x + whole > room.x + room.width) {
      x = room.x;
      y += line;
    }
    if (y + height > room.y + room.height) return;
    place(sheet, key.colours, {x, y, width, height});
    const std::string name = cut_to(key.name, kSmallText, room.x + room.width - x - width - 6);
    write_text(sheet, name, {x + width + 6, y + height / 2 + kSmallText / 2 - 1}, kSmallText, kInk);
    x += whole + 16;
  }
}

}  // namespace

CodeImage contact_sheet(const std::vector<MattePanel>& panels, const std::string& heading,
                        const std::vector<std::string>& lines, int wanted_columns) {
  const CodeImage& first = panels.front().picture;
  const double fit = static_cast<double>(kPanel_px) / std::max(first.width_px, first.height_px);
  const double scale = fit >= 1.0 ? std::floor(fit) : fit;
  const auto scaled = [scale](int side) { return std::max(1, static_cast<int>(std::lround(scale * side))); };
  const cv::Size picture(scaled(first.width_px), scaled(first.height_px));
  const int count = static_cast<int>(panels.size());
  const int suitable_columns = picture.width > 2 * picture.height ? 2 : 4;
  const int columns = std::min(wanted_columns > 0 ? wanted_columns : suitable_columns, count);
  const bool legends =
      std::ranges::any_of(panels, [](const MattePanel& panel) { return panel.bar || !panel.keys.empty(); });
  const int cell_width = std::max(picture.width, kMinPanel_px);
  const int cell_height = kTitle + picture.height + (legends ? 10 + kLegend : 0);
  const int top = kMargin + kHeading + kLine * static_cast<int>(lines.size());
  const int rows = (count + columns - 1) / columns;
  cv::Mat sheet(top + rows * (cell_height + kGap) - kGap + kMargin / 2,
                2 * kMargin + columns * (cell_width + kGap) - kGap, CV_8UC3, cv::Scalar::all(255));
  const int width = sheet.cols - 2 * kMargin;
  write_text(sheet, cut_to(heading, kLargeText, width), {kMargin, kMargin + kLargeText - 4}, kLargeText,
             kInk);
  for (size_t i = 0; i < lines.size(); ++i) {
    write_text(sheet, cut_to(lines[i], kText, width),
               {kMargin, kMargin + kHeading + kLine * static_cast<int>(i)}, kText, kPaleInk);
  }
  for (int i = 0; i < count; ++i) {
    const MattePanel& panel = panels[i];
    const int x = kMargin + i % columns * (cell_width + kGap), y = top + i / columns * (cell_height + kGap);
    write_text(sheet, cut_to(panel.title, kText, cell_width), {x, y + kText}, kText, kInk);
    place(sheet, panel.picture, {x, y + kTitle, picture.width, picture.height});
    const cv::Rect legend(x, y + kTitle + picture.height + 10, cell_width, kLegend);
    if (panel.bar) draw_bar(sheet, *panel.bar, legend);
    draw_keys(sheet, panel.keys, legend);
  }
  CodeImage out(sheet.cols, sheet.rows);
  for (int y = 0; y < sheet.rows; ++y) {
    for (int x = 0; x < sheet.cols; ++x) {
      for (int c = 0; c < 3; ++c) out.at(x, y, c) = sheet.at<cv::Vec3b>(y, x)[2 - c];
    }
  }
  return out;
}

absl::StatusOr<std::string> encode_png8(const CodeImage& image) {
  return encode_picture(".png", mat_of(image), {cv::IMWRITE_PNG_COMPRESSION, 9});
}

}  // namespace glasswing
