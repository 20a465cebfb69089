// The Khronos validator's verdict on a .glb: exits with 1 when there are errors or warnings.
const fs = require('fs');
const validator = require('gltf-validator');

validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 20 }).then((report) => {
  const { numErrors, numWarnings, messages } = report.issues;
  console.log(JSON.stringify({ errors: numErrors, warnings: numWarnings, skins: report.info.hasSkins, animations: report.info.animationCount }));
  if (numErrors + numWarnings > 0) {
    console.error(JSON.stringify(messages.filter((m) => m.severity < 2), null, 1));
    process.exit(1);
  }
});
