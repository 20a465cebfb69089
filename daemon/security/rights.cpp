// Texts around names that need no escaping.
#include "daemon/security/rights.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

namespace booth::daemon {
namespace {

constexpr const char* kRoles[] = {"booth", "viewer", "console"};

// A star at the end: the next release's topics stand beside this one's (booth/skeleton_v2), and nobody has to be given new permissions for them.
const std::vector<std::string> kTold{"booth/skeleton*", "booth/body*", "booth/status*", "booth/event*"};
const std::vector<std::string> kCommand{"booth/command*"}, kReply{"booth/reply*"}, kRos{"rt/*"};

constexpr const char* kDomains = "<domains><id_range><min>0</min><max>230</max></id_range></domains>";  // the plugins know no higher domain

std::string elements(const char* outer, const char* inner, const std::vector<std::string>& texts) {
  if (texts.empty()) return "";
  std::string out = fmt::format("          <{}>", outer);
  for (const auto& text : texts) out += fmt::format("<{}>{}</{}>", inner, text, inner);
  return out + fmt::format("</{}>\n", outer);
}

/// What stands between the first <name ...> at or after `at` and its </name>; moves `at` behind it. Nothing when there is none.
std::optional<std::string> element(const std::string& xml, const std::string& name, std::size_t& at) {
  for (std::size_t open = xml.find("<" + name, at); open != std::string::npos; open = xml.find("<" + name, open + 1)) {
    const std::size_t after = open + 1 + name.size();
    if (after >= xml.size() || (xml[after] != '>' && xml[after] != ' ')) continue;
    const std::size_t begin = xml.find('>', after), end = xml.find("</" + name + ">", after);
    if (begin == std::string::npos || end == std::string::npos || begin >= end) return std::nullopt;
    at = end + name.size() + 3;
    return xml.substr(begin + 1, end - begin - 1);
  }
  return std::nullopt;
}

std::optional<std::string> first(const std::string& xml, const std::string& name) {
  std::size_t at = 0;
  return element(xml, name, at);
}

std::string trimmed(std::string text) {
  const auto from = text.find_first_not_of(" \t\r\n"), to = text.find_last_not_of(" \t\r\n");
  return from == std::string::npos ? "" : text.substr(from, to - from + 1);
}

std::vector<std::string> all(const std::string& xml, const std::string& name) {
  std::vector<std::string> out;
  std::size_t at = 0;
  while (auto one = element(xml, name, at)) out.push_back(trimmed(*std::move(one)));
  return out;
}

std::int64_t instant(const std::string& xml, const char* name) {
  const auto text = first(xml, name);
  const auto out = text ? utc_of(trimmed(*text)) : std::nullopt;
  if (!out) throw std::runtime_error(fmt::format("has no <{}> that can be read", name));
  return *out;
}

}  // namespace

const char* role_name(Role role) { return kRoles[static_cast<std::size_t>(role)]; }

std::optional<Role> role_of(const std::string& name) {
  for (const Role role : {Role::booth, Role::viewer, Role::console})
    if (name == role_name(role)) return role;
  return std::nullopt;
}

std::string identity_name(Role role, const std::string& name) { return fmt::format("{}.{}", role_name(role), name); }

std::optional<IdentityName> parse_identity_name(const std::string& common_name) {
  const std::size_t dot = common_name.find('.');
  const auto role = role_of(common_name.substr(0, dot));
  if (dot == std::string::npos || !role || dot + 1 == common_name.size()) return std::nullopt;
  return IdentityName{*role, common_name.substr(dot + 1)};
}

std::vector<TopicRule> rules_for(Role role, const std::vector<std::string>& booths) {
  if (role == Role::booth) {
    std::vector<std::string> written = kTold;
    written.insert(written.end(), kReply.begin(), kReply.end());
    return {{true, written, booths}, {false, kCommand, booths}, {true, kRos, {}}};
  }
  std::vector<std::string> heard = kTold;
  if (role == Role::console) heard.insert(heard.end(), kReply.begin(), kReply.end());
  std::vector<TopicRule> out{{false, heard, booths}};
  // The ROS 2 mirror has no partitions: whoever hears it hears all booths, so only who may hear all of them gets it.
  if (std::find(booths.begin(), booths.end(), "*") != booths.end()) out.push_back({false, kRos, {}});
  if (role == Role::console) out.push_back({true, kCommand, booths});
  return out;
}

std::string permissions_xml(const std::string& common_name, const std::vector<TopicRule>& rules, const Validity& valid) {
  std::string out = fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\"\n"
      "     xsi:noNamespaceSchemaLocation=\"http://www.omg.org/spec/DDS-Security/20170901/omg_shared_ca_permissions.xsd\">\n"
      "  <permissions>\n    <grant name=\"{0}\">\n      <subject_name>CN={0}</subject_name>\n"
      "      <validity><not_before>{1}</not_before><not_after>{2}</not_after></validity>\n"
      "      <allow_rule>\n        {3}\n",
      common_name, utc_text(valid.from), utc_text(valid.until), kDomains);
  for (const bool publish : {true, false})  // the schema wants them in this order
    for (const auto& rule : rules) {
      if (rule.publish != publish) continue;
      const char* name = publish ? "publish" : "subscribe";
      out += fmt::format("        <{0}>\n{1}{2}        </{0}>\n", name, elements("topics", "topic", rule.topics),
                         elements("partitions", "partition", rule.partitions));
    }
  return out + "      </allow_rule>\n      <default>DENY</default>\n    </grant>\n  </permissions>\n</dds>\n";
}

std::string governance_xml() {
  return fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<dds xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\"\n"
      "     xsi:noNamespaceSchemaLocation=\"http://www.omg.org/spec/DDS-Security/20170901/omg_shared_ca_governance.xsd\">\n"
      "  <domain_access_rules>\n    <domain_rule>\n      {}\n"
      "      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>\n"
      "      <enable_join_access_control>true</enable_join_access_control>\n"
      "      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>\n"
      "      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>\n"
      "      <rtps_protection_kind>NONE</rtps_protection_kind>\n"
      "      <topic_access_rules>\n        <topic_rule>\n          <topic_expression>*</topic_expression>\n"
      "          <enable_discovery_protection>true</enable_discovery_protection>\n"
      "          <enable_liveliness_protection>true</enable_liveliness_protection>\n"
      "          <enable_read_access_control>true</enable_read_access_control>\n"
      "          <enable_write_access_control>true</enable_write_access_control>\n"
      "          <metadata_protection_kind>ENCRYPT_WITH_ORIGIN_AUTHENTICATION</metadata_protection_kind>\n"
      "          <data_protection_kind>NONE</data_protection_kind>\n"
      "        </topic_rule>\n      </topic_access_rules>\n    </domain_rule>\n  </domain_access_rules>\n</dds>\n",
      kDomains);
}

PermissionFacts read_permissions(const std::string& xml) {
  const auto grant = first(xml, "grant");
  if (!grant) throw std::runtime_error("has no <grant>");
  PermissionFacts out;
  out.subject = trimmed(first(*grant, "subject_name").value_or(""));
  out.valid = {instant(*grant, "not_before"), instant(*grant, "not_after")};
  out.denies_the_rest = trimmed(first(*grant, "default").value_or("")) == "DENY";
  for (const auto& allow : all(*grant, "allow_rule"))
    for (const bool publish : {true, false})
      for (const auto& rule : all(allow, publish ? "publish" : "subscribe")) out.rules.push_back({publish, all(rule, "topic"), all(rule, "partition")});
  return out;
}

std::vector<std::string> governance_weaknesses(const std::string& xml) {
  std::vector<std::string> out;
  const auto says = [&](const char* name, const char* value) {
    const auto found = all(xml, name);
    return std::find(found.begin(), found.end(), value) != found.end();
  };
  if (says("allow_unauthenticated_participants", "true")) out.push_back("participants without credentials may join");
  if (says("enable_join_access_control", "false")) out.push_back("permissions are not asked for when somebody joins");
  if (says("enable_read_access_control", "false") || says("enable_write_access_control", "false"))
    out.push_back("some topics may be read or written without permission");
  if (says("metadata_protection_kind", "NONE") && says("data_protection_kind", "NONE") && says("rtps_protection_kind", "NONE"))
    out.push_back("some topics are neither encrypted nor signed");
  return out;
}

}  // namespace booth::daemon
