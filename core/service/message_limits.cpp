#include "core/service/message_limits.h"

#include <fmt/format.h>

#include <vector>

#include "glasswing/v1/limits.pb.h"

namespace glasswing {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// The path of what exceeds its limit, then the reason; empty: nothing does.
std::string excess_of(const Message& message);

std::string excess_of_string(const std::string& text, const FieldDescriptor& field) {
  const int given = field.options().GetExtension(v1::max_bytes);
  const size_t most = given > 0 ? given : kMaxStringBytes;
  if (text.size() <= most) return "";
  return fmt::format(" has {} bytes; it must have at most {}", text.size(), most);
}

std::string excess_of_list(const Message& message, const FieldDescriptor& field) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  const int size = reflection.FieldSize(message, &field);
  const int given = field.options().GetExtension(v1::max_count);
  const int most = given > 0 ? given : kMaxListItems;
  if (size > most) return fmt::format(" has {} items; it must have at most {}", size, most);
  for (int i = 0; i < size; ++i) {
    std::string excess, scratch;
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      excess = excess_of(reflection.GetRepeatedMessage(message, &field, i));
      if (!excess.empty()) excess = "." + excess;
    } else if (field.type() == FieldDescriptor::TYPE_STRING) {
      excess = excess_of_string(reflection.GetRepeatedStringReference(message, &field, i, &scratch), field);
    } else {
      break;
    }
    if (!excess.empty()) return fmt::format("[{}]{}", i, excess);
  }
  return "";
}

std::string excess_of(const Message& message) {
  const google::protobuf::Reflection& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    std::string excess, scratch;
    if (field->is_repeated()) {
      excess = excess_of_list(message, *field);
    } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      excess = excess_of(reflection.GetMessage(message, field));
      if (!excess.empty()) excess = "." + excess;
    } else if (field->type() == FieldDescriptor::TYPE_STRING) {
      excess = excess_of_string(reflection.GetStringReference(message, field, &scratch), *field);
    }
    if (!excess.empty()) return field->name() + excess;
  }
  return "";
}

}  // namespace

absl::Status check_limits(const Message& message) {
  const std::string excess = excess_of(message);
  return excess.empty() ? absl::OkStatus() : absl::InvalidArgumentError(excess);
}

std::string fitted(std::string text, int max_bytes) {
  size_t size = max_bytes;
  if (text.size() <= size) return text;
  while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xc0u) == 0x80u) --size;
  text.resize(size);
  return text;
}

}  // namespace glasswing
