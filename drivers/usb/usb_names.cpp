// Small grammars, written out so that nothing else passes.
#include "drivers/usb/usb_names.hpp"

namespace booth::drivers::usb {
namespace {

/// 1 to 255 without leading zeros, eaten from the front of the text; 0 when there is none.
int eat_number(std::string_view& text) {
  int value = 0;
  std::size_t used = 0;
  while (used < text.size() && used < 3 && text[used] >= '0' && text[used] <= '9') {
    if (used == 0 && text[used] == '0') return 0;
    value = 10 * value + (text[used++] - '0');
  }
  text.remove_prefix(used);
  return value <= 255 ? value : 0;
}

bool is_hex(std::string_view text) {
  for (const char c : text)
    if (!((c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'))) return false;
  return !text.empty();
}

}  // namespace

std::optional<PortName> parse_port_name(std::string_view text) {
  constexpr int kDeepest = 7;
  const std::string_view whole = text;
  PortName out;
  out.bus = eat_number(text);
  if (out.bus == 0 || !text.starts_with('-')) return std::nullopt;
  out.hub = "usb" + std::to_string(out.bus);
  for (int depth = 1; depth <= kDeepest; ++depth) {
    if (depth > 1) out.hub = whole.substr(0, whole.size() - text.size());
    text.remove_prefix(1);
    out.port = eat_number(text);
    if (out.port == 0) return std::nullopt;
    if (text.empty()) return out;
    if (!text.starts_with('.')) return std::nullopt;
  }
  return std::nullopt;
}

bool is_pci_address(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon < 4 || colon > 8 || text.size() != colon + 8) return false;
  const std::string_view rest = text.substr(colon);
  return is_hex(text.substr(0, colon)) && is_hex(rest.substr(1, 2)) && rest[3] == ':' && is_hex(rest.substr(4, 2)) && rest[6] == '.' && rest[7] >= '0' &&
         rest[7] <= '7';
}

bool is_xhci_driver(std::string_view name) { return name == "xhci_hcd" || name == "xhci-pci-renesas" || name == "xhci_pci_renesas"; }

}  // namespace booth::drivers::usb
