// What is read from a planted /sys: healthy machines, poor ones, and trees that lie.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "drivers/usb/descriptors.hpp"
#include "drivers/usb/sysfs_topology.hpp"
#include "drivers/usb/usb_names.hpp"
#include "tests/drivers/usb/planted_sysfs.hpp"

namespace booth::drivers::usb {
namespace {

using hal::UsbSpeed;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using tests::PlantedSysfs;

hal::UsbTopology read(const PlantedSysfs& tree) { return make_sysfs_topology(tree.root())->read(); }

std::vector<const hal::UsbDevice*> sensors(const hal::UsbTopology& t) {
  std::vector<const hal::UsbDevice*> out;
  for (const auto& d : t.devices)
    if (d.vendor == 0x045E) out.push_back(&d);
  return out;
}

TEST(PortNames, AreDigitsOneDashAndDots) {
  const auto deep = parse_port_name("12-3.4.5");
  ASSERT_TRUE(deep);
  EXPECT_EQ(deep->bus, 12);
  EXPECT_EQ(deep->hub, "12-3.4");
  EXPECT_EQ(deep->port, 5);
  EXPECT_EQ(parse_port_name("2-1")->hub, "usb2");
  for (const char* bad : {"", "2", "2-", "-1", "2-0", "02-1", "2-1.", "2-1..3", "2-1/../../x", "2-1:1.0", "2-256", "2-1.1.1.1.1.1.1.1", "2-1 ", " 2-1", "2-1\n",
                          "usb2", "999-1", "2-1.a", "2--1"})
    EXPECT_FALSE(parse_port_name(bad)) << bad;
}

TEST(PciAddresses, HaveTheirFourPlaces) {
  EXPECT_TRUE(is_pci_address("0000:03:00.0"));
  EXPECT_TRUE(is_pci_address("10000:e1:1f.7"));
  for (const char* bad :
       {"", "0000:03:00", "0000:03:00.8", "0000:03:00.0/..", "000:03:00.0", "0000:03:00.0\n", "0000:G3:00.0", "../../../../x.0", "0000:03:00:0"})
    EXPECT_FALSE(is_pci_address(bad)) << bad;
}

TEST(Descriptors, SayWhatEachAlternateSettingReserves) {
  const std::string text = tests::sensor_descriptors();
  const auto all = alternate_settings(std::as_bytes(std::span(text)), UsbSpeed::super_5000);
  ASSERT_THAT(all, SizeIs(3));
  EXPECT_DOUBLE_EQ(all[0].reserved, 64 / 16e-3) << "the interrupt endpoint";
  EXPECT_EQ(all[1].reserved, 0) << "alternate setting 0 reserves nothing";
  EXPECT_DOUBLE_EQ(all[2].reserved, 33'792 / 125e-6);
  EXPECT_EQ(all[2].interface, 1);
  EXPECT_EQ(all[2].alternate, 1);
}

TEST(Descriptors, OfHighSpeedDevicesCountTheirTransactions) {
  const std::vector<unsigned char> bytes{9, 2, 0, 0, 1, 1, 0, 0, 0, 9, 4, 0, 1, 1, 1, 2, 0, 0, 7, 5, 0x81, 5, 0x00, 0x14, 2};
  const auto all = alternate_settings(std::as_bytes(std::span(bytes)), UsbSpeed::high_480);
  ASSERT_THAT(all, SizeIs(1));
  EXPECT_DOUBLE_EQ(all[0].reserved, 3 * 1024 / 250e-6);
}

TEST(Descriptors, EveryCutAndEveryFlippedByteIsSurvived) {
  const std::string good = tests::sensor_descriptors();
  for (std::size_t n = 0; n <= good.size(); ++n) (void)alternate_settings(std::as_bytes(std::span(good).first(n)), UsbSpeed::super_5000);
  for (std::size_t i = 0; i < good.size(); ++i)
    for (const char with : {'\0', '\1', '\x7f', '\xff'}) {
      std::string bad = good;
      bad[i] = with;
      for (const auto& s : alternate_settings(std::as_bytes(std::span(bad)), UsbSpeed::super_5000)) {
        EXPECT_GE(s.reserved, 0);
        EXPECT_LE(s.reserved, 255 * 65'535 / 125e-6);
      }
    }
}

TEST(Topology, OfOneControllerWithFourSensorsShowsThatTheyShareABus) {
  PlantedSysfs tree;
  tree.controller({});
  for (int i = 1; i <= 4; ++i) tree.sensor("2-" + std::to_string(i), {.serial = "00000000000" + std::to_string(i), .streaming = i == 1});
  const auto t = read(tree);
  EXPECT_TRUE(t.available);
  EXPECT_EQ(t.usbfs_memory_mb, 16);
  EXPECT_THAT(t.remarks, IsEmpty());
  ASSERT_THAT(t.controllers, SizeIs(1));
  const auto& c = t.controllers[0];
  EXPECT_EQ(c.id, "0000:00:14.0");
  EXPECT_TRUE(c.on_pci);
  EXPECT_EQ(c.vendor, 0x8086);
  EXPECT_EQ(c.device, 0xA36D);
  EXPECT_EQ(c.vendor_name, "Intel");
  EXPECT_EQ(c.driver, "xhci_hcd");
  EXPECT_THAT(c.links, IsEmpty()) << "built into the chipset";
  ASSERT_THAT(c.buses, SizeIs(2));
  EXPECT_EQ(c.buses[1].number, 2);
  EXPECT_EQ(c.buses[1].speed, UsbSpeed::super_5000);
  EXPECT_EQ(c.buses[1].ports, 8);
  EXPECT_DOUBLE_EQ(c.buses[1].reserved, 33'792 / 125e-6 + 4 * 64 / 16e-3);
  const auto found = sensors(t);
  ASSERT_THAT(found, SizeIs(4));
  EXPECT_EQ(found[0]->path, "2-1");
  EXPECT_EQ(found[0]->serial, "000000000001");
  EXPECT_EQ(found[0]->controller, "0000:00:14.0");
  EXPECT_EQ(found[0]->product_name, "Xbox NUI Sensor");
  EXPECT_TRUE(found[0]->stays_awake);
  EXPECT_TRUE(found[0]->node_exists);
  EXPECT_TRUE(found[0]->port_switch);
  ASSERT_THAT(found[0]->interfaces, SizeIs(2));
  EXPECT_EQ(found[0]->interfaces[1].alternate, 1);
  EXPECT_EQ(found[0]->interfaces[1].driver, "usbfs");
  const auto shared = sharing_a_bus(found);
  ASSERT_THAT(shared, SizeIs(1));
  EXPECT_THAT(shared[0], SizeIs(4));
}

TEST(Topology, OfACardWithFourControllersShowsNobodySharingAndTheLinkTheyAllUse) {
  PlantedSysfs tree;
  for (int i = 0; i < 4; ++i) {
    tree.controller({.address = "0000:0" + std::to_string(4 + i) + ":00.0",
                     .vendor = "0x1912",
                     .device = "0x0015",
                     .first_bus = 1 + 2 * i,
                     .link_width = "1",
                     .link_speed = "5.0 GT/s PCIe",
                     .switches = {"0000:00:01.0", "0000:02:00.0", "0000:03:0" + std::to_string(i) + ".0"}});
    tree.sensor(std::to_string(2 + 2 * i) + "-1", {.serial = "00000000000" + std::to_string(i)});
  }
  const auto t = read(tree);
  ASSERT_THAT(t.controllers, SizeIs(4));
  EXPECT_THAT(sharing_a_bus(sensors(t)), IsEmpty());
  for (const auto& c : t.controllers) {
    EXPECT_EQ(c.vendor_name, "Renesas");
    ASSERT_THAT(c.links, SizeIs(4)) << "the controller's own, and one for each bridge";
    EXPECT_EQ(c.links[0].address, c.id);
    EXPECT_DOUBLE_EQ(c.links[0].capacity(), 500e6);
    EXPECT_DOUBLE_EQ(c.links[3].capacity(), 2000e6);
  }
}

TEST(Topology, ShowsADeadControllerAndOneWithoutADriver) {
  PlantedSysfs tree;
  tree.controller({.address = "0000:05:00.0", .vendor = "0x1b21", .device = "0x1142", .dead = true});
  tree.controller({.address = "0000:06:00.0", .vendor = "0x1b6f", .driver = ""});
  const auto t = read(tree);
  ASSERT_THAT(t.controllers, SizeIs(2));
  EXPECT_EQ(t.controllers[0].vendor_name, "ASMedia");
  EXPECT_EQ(t.controllers[0].driver, "xhci_hcd");
  EXPECT_THAT(t.controllers[0].buses, IsEmpty());
  EXPECT_EQ(t.controllers[1].driver, "");
  EXPECT_FALSE(t.controllers[1].may_rebind);
}

TEST(Topology, SeesUsb2SpeedAudioAndSleep) {
  PlantedSysfs tree;
  tree.controller({});
  tree.sensor("1-3", {.speed = "480", .audio = true, .autosuspend = true, .node = false});
  const auto t = read(tree);
  const auto found = sensors(t);
  ASSERT_THAT(found, SizeIs(1));
  EXPECT_EQ(found[0]->speed, UsbSpeed::high_480);
  EXPECT_FALSE(is_super(found[0]->speed));
  EXPECT_FALSE(found[0]->stays_awake);
  EXPECT_FALSE(found[0]->node_exists);
  ASSERT_THAT(found[0]->interfaces, SizeIs(4));
  EXPECT_EQ(found[0]->interfaces[2].driver, "snd-usb-audio");
}

TEST(Topology, OfAPlatformControllerHasNoPciAddress) {
  PlantedSysfs tree;
  tree.make("sys/devices/platform/vhci_hcd.0/usb1");
  tree.link("sys/bus/usb/devices/usb1", "sys/devices/platform/vhci_hcd.0/usb1");
  tree.set("sys/devices/platform/vhci_hcd.0/usb1/speed", "5000");
  const auto t = read(tree);
  ASSERT_THAT(t.controllers, SizeIs(1));
  EXPECT_EQ(t.controllers[0].id, "vhci_hcd.0");
  EXPECT_FALSE(t.controllers[0].on_pci);
  EXPECT_FALSE(t.controllers[0].may_rebind);
}

TEST(Topology, OfAMachineWithoutUsbIsEmpty) {
  const tests::TemporaryFolder empty;
  const auto t = make_sysfs_topology(empty.path)->read();
  EXPECT_FALSE(t.available);
  EXPECT_FALSE(t.usbfs_memory_mb);
  EXPECT_THAT(t.controllers, IsEmpty());
  EXPECT_THAT(make_sysfs_topology("/nonexistent/root")->read().devices, IsEmpty());
}

TEST(Topology, LacksOnlyWhatIsMissing) {
  PlantedSysfs tree;
  tree.controller({});
  tree.sensor("2-1", {});
  const auto folder = tree.root() / tree.folder_of("2-1");
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(tree.root() / "sys"))
    if (entry.is_regular_file()) files.push_back(entry.path());
  // Each attribute of the whole tree away by itself.
  for (const auto& file : files) {
    const std::string text = tests::read_text(file);
    std::filesystem::remove(file);
    const auto t = read(tree);
    EXPECT_EQ(find_device(t, "2-1") != nullptr, true) << file;
    std::ofstream(file, std::ios::binary) << text;
  }
}

TEST(Topology, SurvivesHostileContentInEachAttribute) {
  PlantedSysfs tree;
  tree.controller({.link_width = "1", .link_speed = "5.0 GT/s PCIe"});
  tree.sensor("2-1", {.streaming = true, .audio = true});
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(tree.root() / "sys"))
    if (entry.is_regular_file()) files.push_back(entry.path());
  const std::string endless(200'000, 'A');
  for (const std::string& evil :
       {std::string(), std::string("\0\xff\x1b[2J\n", 7), std::string("-1"), std::string("99999999999999999999"), std::string("nan"), endless})
    for (const auto& file : files) {
      const std::string text = tests::read_text(file);
      std::ofstream(file, std::ios::binary) << evil;
      const auto t = read(tree);
      for (const auto& d : t.devices) {
        EXPECT_LE(d.serial.size(), 127u);
        EXPECT_EQ(d.serial.find('\x1b'), std::string::npos) << file;
        EXPECT_GE(d.address, 0);
      }
      for (const auto& c : t.controllers)
        for (const auto& l : c.links) EXPECT_GE(l.capacity(), 0) << file;
      std::ofstream(file, std::ios::binary) << text;
    }
}

TEST(Topology, FollowsNoLinkOutOfItsTreeNorInACircle) {
  PlantedSysfs tree;
  tree.controller({});
  const tests::TemporaryFolder elsewhere;
  elsewhere.write("2-5/serial", "secret");
  std::filesystem::create_symlink(elsewhere.path / "2-5", tree.root() / "sys/bus/usb/devices/2-5");
  std::filesystem::create_symlink("2-6", tree.root() / "sys/bus/usb/devices/2-6");
  std::filesystem::create_symlink("nowhere", tree.root() / "sys/bus/usb/devices/2-7");
  tree.set("sys/bus/usb/devices/2-8", "a file");
  tree.make("sys/bus/usb/devices/$(reboot)");
  const auto t = read(tree);
  EXPECT_THAT(t.devices, SizeIs(2)) << "the two root hubs";
  EXPECT_THAT(t.remarks, SizeIs(5));
}

TEST(Topology, ReadsNeitherALinkNorAPipeInTheplaceOfAnAttribute) {
  PlantedSysfs tree;
  tree.controller({});
  tree.sensor("2-1", {});
  const tests::TemporaryFolder elsewhere;
  const auto folder = tree.root() / tree.folder_of("2-1");
  std::filesystem::remove(folder / "serial");
  std::filesystem::create_symlink(elsewhere.write("secret", "secret"), folder / "serial");
  std::filesystem::remove(folder / "product");
  ASSERT_EQ(::mkfifo((folder / "product").c_str(), 0600), 0);
  const auto t = read(tree);
  const auto* d = find_device(t, "2-1");
  ASSERT_NE(d, nullptr);
  EXPECT_EQ(d->serial, "");
  EXPECT_EQ(d->product_name, "");
}

}  // namespace
}  // namespace booth::drivers::usb
