// PatchReader on arbitrary pictures. The input is 16-bit values: first the id of an eleventh picture, then
// what a camera adds to each pixel of the ten learning pictures and of that one.
#include <cstring>

#include "core/pattern/id_patch.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

constexpr IdPatch kPatch{.width_px = IdPatch::kMinWidth_px, .first_row = 0, .rows = IdPatch::kMinRows};

Image16 picture_of(std::uint16_t id) {
  RadianceImage radiance(kPatch.width_px, kPatch.rows);
  kPatch.draw(id, radiance);
  Image16 image(kPatch.width_px, kPatch.rows);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = radiance.samples[i] > 0.0f ? 40000 : 9;
  return image;
}

// Consumes the input from its front; wraps around, so that any input makes a whole picture.
void disturb(Image16& image, std::string_view& input) {
  const size_t bytes = std::min(input.size(), image.samples.size() * 2);
  for (size_t i = 0; i + 1 < bytes; i += 2) {
    std::uint16_t added = 0;
    std::memcpy(&added, &input[i], 2);
    image.samples[i / 2] = static_cast<std::uint16_t>(image.samples[i / 2] + added);
  }
  input.remove_prefix(bytes);
}

// Light of a column's upper cell less that of its lower cell.
double upper_less_lower(const Image16& image, int column) {
  double sum = 0.0;
  const int half = kPatch.rows / 2, cell = kPatch.width_px / IdPatch::kBits;
  for (int y = 0; y < kPatch.rows; ++y) {
    for (int x = column * cell; x < (column + 1) * cell; ++x) {
      for (int c = 0; c < 3; ++c)
        sum += y < half ? image.at(x, y, c) : -static_cast<double>(image.at(x, y, c));
    }
  }
  return sum;
}

}  // namespace

std::vector<std::string> seeds() {
  const size_t picture_bytes = picture_of(0).samples.size() * 2;
  std::vector<std::string> seeds{std::string("\x34\x12", 2),
                                 std::string("\xff\xff", 2) + std::string(40, '\1'),
                                 std::string(2 + 11 * picture_bytes, '\0')};
  for (size_t i = 0; i < 11 * picture_bytes; ++i)
    seeds.back()[2 + i] = static_cast<char>(i % 2 == 0 ? i * 37 : i % 3);
  seeds.push_back(std::string("\xaa\xaa", 2) + std::string(10 * picture_bytes, '\0') +
                  std::string(picture_bytes / 2, '\x60'));
  return seeds;
}

void try_input(std::string_view input) {
  std::uint16_t shown = 0;
  std::memcpy(&shown, input.data(), std::min<size_t>(input.size(), 2));
  input.remove_prefix(std::min<size_t>(input.size(), 2));
  std::string_view rest = input;
  std::vector<Image16> learning, clean;
  for (const std::uint16_t id : patch_learning_ids()) {
    clean.push_back(picture_of(id));
    learning.push_back(clean.back());
    disturb(learning.back(), rest);
  }
  Image16 frame = picture_of(shown);
  disturb(frame, rest);

  // Whatever it learned from, it reads nothing else out of that.
  if (const absl::StatusOr<PatchReader> reader = PatchReader::learn(learning); reader.ok()) {
    for (size_t i = 0; i < learning.size(); ++i) {
      const std::optional<std::uint16_t> id = reader->read(learning[i]);
      FUZZ_CHECK(!id || *id == (patch_learning_ids()[i] & reader->bits()));
    }
    (void)reader->read(frame);
    FUZZ_CHECK(!reader->read(Image16(kPatch.width_px, kPatch.rows + 1)));
  } else {
    FUZZ_CHECK(!reader.status().message().empty());
  }

  // With a correctly learned patch, an id must agree with the light of every cell.
  static const PatchReader exact = PatchReader::learn(clean).value();
  FUZZ_CHECK(exact.read(picture_of(shown)) == shown);
  Image16 other = picture_of(shown);
  disturb(other, input);
  for (const Image16* seen : {&frame, &other}) {
    const std::optional<std::uint16_t> id = exact.read(*seen);
    if (!id) continue;
    FUZZ_CHECK(exact.read(picture_of(*id)) == *id);
    for (int column = 0; column < IdPatch::kBits; ++column)
      FUZZ_CHECK((upper_less_lower(*seen, column) > 0.0) == ((*id >> column & 1) != 0));
  }
}

}  // namespace glasswing::fuzz
