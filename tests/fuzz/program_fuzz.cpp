// Programs and calibrations as a display receives them, and the resulting pictures. The input is a
// LoadProgramRequest, as text or in wire format.
#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/text_format.h>

#include "core/image/image_file.h"
#include "display-node/playback/program.h"
#include "tests/fuzz/fuzz_target.h"

namespace glasswing::fuzz {
namespace {

using google::protobuf::TextFormat;

const std::vector<ScreenInfo>& screens() {
  static const std::vector<ScreenInfo> list{
      {.name = "back", .width_px = 32, .height_px = 10, .patch_rows = 4, .bits = 10},
      {.name = "left", .width_px = 5, .height_px = 4}};
  return list;
}

const ImageStore& images() {
  static ImageStore store;
  static const bool there = store.add(encode_png16(Image16(5, 4)).value()).ok();
  FUZZ_CHECK(there);
  return store;
}

void try_program(const v1::LoadProgramRequest& request) {
  const absl::StatusOr<Program> program = Program::create(request, screens(), images());
  if (!program.ok()) {
    FUZZ_CHECK(!program.status().message().empty());
    return;
  }
  FUZZ_CHECK(program->size() == static_cast<size_t>(request.steps_size()));
  for (size_t step = 0; step < std::min<size_t>(program->size(), 8); ++step) {
    const std::vector<Picture> pictures = program->pictures(step);
    FUZZ_CHECK(pictures.size() == screens().size());
    for (size_t i = 0; i < pictures.size(); ++i) {
      const ScreenInfo& screen = screens()[i];
      if (pictures[i] == nullptr) continue;
      FUZZ_CHECK(pictures[i]->width_px == screen.width_px && pictures[i]->height_px == screen.height_px);
      for (const std::uint16_t code : pictures[i]->samples) FUZZ_CHECK(code >> screen.bits == 0);
    }
  }
}

class Ignored final : public google::protobuf::io::ErrorCollector {
  void AddError(int, int, const std::string&) override {}
};

}  // namespace

std::vector<std::string> seeds() {
  std::string image = encode_png16(Image16(5, 4)).value();
  ImageStore store;
  const std::string name = store.add(image).value();
  const std::string text = R"(program: "p" hold_refreshes: 2
steps { step: 0 patch_id: 7 stimuli { kind: "gauss_stripe" panel: "back" phi_deg: 30 r_px: 4 sigma_px: 2 peak: 1 } }
steps { step: 1 patch_id: 8 stimuli { kind: "sinusoid" panel: "back" phi_deg: 90 period_px: 8 phase_deg: 45 peak: 0.5 } }
steps { step: 2 stimuli { kind: "square" panel: "left" orient: "vertical_bars" bar_width_px: 2 inverse: true offset_px: 1 } }
steps { step: 3 stimuli { kind: "ramp" panel: "left" } stimuli { kind: "solid" panel: "back" colour: [0, 0.5, 1] codes: true } }
steps { step: 4 stimuli { kind: "patch" panel: "back" patch_id: 65535 } }
steps { step: 5 stimuli { kind: "photo" panel: "left" image: ")" +
                           name + R"(" } }
)";
  v1::LoadProgramRequest request;
  FUZZ_CHECK(TextFormat::ParseFromString(text, &request));
  return {text, request.SerializeAsString()};
}

void try_input(std::string_view input) {
  static const google::protobuf::LogSilencer silent;  // silences complaints about strings that are not UTF-8
  v1::LoadProgramRequest request;
  if (request.ParseFromArray(input.data(), static_cast<int>(input.size()))) try_program(request);
  TextFormat::Parser parser;
  Ignored ignored;
  parser.RecordErrorsTo(&ignored);
  if (parser.ParseFromString(std::string(input), &request)) try_program(request);
}

}  // namespace glasswing::fuzz
