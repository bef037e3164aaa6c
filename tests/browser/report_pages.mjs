// Loads report pages in Chromium: `node report_pages.mjs LIBRARIES CHROMIUM PAGE...`. Every page is loaded on a narrow and
// on a wide screen, light and dark; a figure is zoomed and a value read at the pointer; the page is printed, and read
// without scripts. Nothing may be loaded from elsewhere, reported on the console, refused by the content security policy
// or found by axe-core. SCREENSHOTS names a folder for pictures of what was seen.
import assert from "node:assert/strict";
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { pathToFileURL } from "node:url";

const [libraries, chromium, ...pages] = process.argv.slice(2);
const require = createRequire(path.join(path.resolve(libraries), "package.json"));
const puppeteer = require("puppeteer-core");
const axe = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const screenshots = process.env.SCREENSHOTS;

let checks = 0;
function check(value, message) {
  ++checks;
  assert.ok(value, message);
}

async function opened(browser, file, { width, scheme, scripts = true }) {
  const page = await browser.newPage();
  const faults = [];
  await page.setJavaScriptEnabled(scripts);
  await page.setViewport({ width, height: 900, isMobile: width < 500 });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warn") faults.push(`console: ${message.text()}`);
  });
  page.on("pageerror", (error) => faults.push(`exception: ${error.message}`));
  const url = pathToFileURL(path.resolve(file)).href;
  page.on("request", (request) => {
    if (request.url() !== url) faults.push(`request: ${request.url().slice(0, 200)}`);
  });
  if (scripts) {
    await page.evaluateOnNewDocument(() => {
      window.violations = [];
      document.addEventListener("securitypolicyviolation", (event) => {
        window.violations.push(`${event.violatedDirective} ${event.blockedURI} ${event.sample}`);
      });
    });
  }
  await page.goto(url, { waitUntil: "load" });
  return { page, faults };
}

async function faultless(page, faults, where) {
  const violations = await page.evaluate(() => window.violations ?? []);
  check(violations.length === 0, `${where}: content security policy: ${violations.join("; ")}`);
  check(faults.length === 0, `${where}: ${faults.join("; ")}`);
}

/// A drag over the middle of the first interactive figure narrows its axis; "Show all" widens it again.
async function zoomed(page, where) {
  const plot = await page.$(".plot");
  await plot.scrollIntoView();
  const ranges = () => page.evaluate(() => {
    const graph = document.querySelector(".chart.interactive").graph;
    return [graph.xAxisRange(), graph.yAxisRange()];
  });
  const before = await ranges();
  const box = await plot.boundingBox();
  await page.mouse.move(box.x + 0.4 * box.width, box.y + 0.5 * box.height);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.55 * box.width, box.y + 0.5 * box.height, { steps: 3 });
  await page.mouse.move(box.x + 0.7 * box.width, box.y + 0.5 * box.height, { steps: 3 });
  await page.mouse.up();
  const after = await ranges();
  check(after[0][0] > before[0][0] && after[0][1] < before[0][1], `${where}: a drag did not zoom: ${before} to ${after}`);
  const button = await page.$(".all:not([hidden])");
  check(button, `${where}: a zoomed figure has no button "Show all"`);
  await button.click();
  const restored = await ranges();
  for (const axis of [0, 1]) {
    for (const end of [0, 1]) {
      const width = before[axis][1] - before[axis][0];
      check(Math.abs(restored[axis][end] - before[axis][end]) < 1e-6 * width,
        `${where}: "Show all" left ${restored} instead of ${before}`);
    }
  }
  check(await page.evaluate(() => document.querySelector(".all").hidden), `${where}: "Show all" stays`);
}

/// The value of a point under the pointer is that of the page's data.
async function valueRead(page, where) {
  const wanted = await page.evaluate(() => {
    const figure = document.querySelector(".chart.interactive");
    const chart = JSON.parse(document.getElementById("figures").textContent).find((one) => one.id === figure.id);
    const curve = chart.curves.findIndex((one) => one.style !== "band" && one.label);
    const rows = chart.rows.filter((one) => one[curve + 1]);
    const row = rows[Math.floor(rows.length / 2)];
    const place = figure.querySelector(".plot").getBoundingClientRect();
    const area = figure.graph.getArea();
    // toDomXCoord() of dygraphs is wrong on logarithmic axes.
    const scaled = chart.x.log ? Math.log : Number;
    const [lo, hi] = chart.x.range.map((end) => scaled(end));
    return {
      label: chart.curves[curve].label, value: row[curve + 1][1],
      x: place.x + area.x + area.w * (scaled(row[0]) - lo) / (hi - lo), y: place.y + area.y + 0.5 * area.h
    };
  });
  await page.mouse.move(wanted.x + 1, wanted.y + 1);
  await page.mouse.move(wanted.x, wanted.y);
  const shown = await page.evaluate(() => document.querySelector(".chart.interactive .readout").textContent);
  const value = String(Number(wanted.value.toPrecision(4)));
  const found = shown.includes(`${wanted.label}: ${value}`) ||
    new RegExp(`at [^:;]*: ${value.replace(/[.+]/g, "\\$&")}`).test(shown);
  check(found, `${where}: "${shown}" lacks ${wanted.label}: ${value}`);
}

async function accessible(page, where) {
  await page.evaluate(axe);
  const found = await page.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
  const text = found.violations.map((one) => `${one.id}: ${one.help}: ${one.nodes[0].html.slice(0, 200)}`).join("\n");
  check(found.violations.length === 0, `${where}: axe-core found\n${text}`);
}

async function seen(page, name) {
  if (!screenshots) return;
  fs.mkdirSync(screenshots, { recursive: true });
  await page.screenshot({ path: path.join(screenshots, `${name}.png`), fullPage: true });
}

const browser = await puppeteer.launch({
  executablePath: chromium, headless: true,
  args: ["--no-sandbox", "--disable-dev-shm-usage", "--disable-gpu", "--no-first-run", "--disable-extensions"]
});
try {
  for (const file of pages) {
    const name = path.basename(file, ".report.html");
    for (const width of [360, 1280]) {
      for (const scheme of ["light", "dark"]) {
        const where = `${name}, ${width} px, ${scheme}`;
        const { page, faults } = await opened(browser, file, { width, scheme });
        const interactive = await page.evaluate(() => document.querySelectorAll(".chart.interactive").length);
        // A figure whose values are all missing stays as it is drawn.
        const drawn = await page.evaluate(() => JSON.parse(document.getElementById("figures")?.textContent ?? "[]")
          .filter((chart) => chart.rows.length > 0).length || document.querySelectorAll(".chart").length);
        check(drawn > 0, `${where}: no figure`);
        const wide = await page.evaluate(() => document.documentElement.scrollWidth > window.innerWidth);
        check(!wide, `${where}: the page is wider than the screen`);
        if (await page.$("#figures")) {
          check(interactive === drawn, `${where}: ${interactive} of ${drawn} figures are interactive`);
          await seen(page, `${name}-${width}-${scheme}`);
          await zoomed(page, where);
          await valueRead(page, where);
        }
        await page.evaluate(() => document.querySelectorAll("details").forEach((one) => { one.open = true; }));
        await accessible(page, where);
        await faultless(page, faults, where);
        await page.close();
      }
    }
    const { page, faults } = await opened(browser, file, { width: 1280, scheme: "light" });
    await page.emulateMediaType("print");
    const printed = await page.evaluate(() => [...document.querySelectorAll(".chart")].every((figure) =>
      getComputedStyle(figure.querySelector(".scroll")).display !== "none" &&
      (!figure.querySelector(".live") || getComputedStyle(figure.querySelector(".live")).display === "none")));
    check(printed, `${name}: the drawn figures are not those that are printed`);
    await seen(page, `${name}-print`);
    await faultless(page, faults, `${name}, printed`);
    await page.close();

    const plain = await opened(browser, file, { width: 360, scheme: "light", scripts: false });
    const visible = await plain.page.$$eval(".chart svg[role=img]", (all) =>
      all.every((one) => one.getBoundingClientRect().height > 100));
    check(visible, `${name}: a figure is not seen without scripts`);
    check(plain.faults.length === 0, `${name}, without scripts: ${plain.faults.join("; ")}`);
    await seen(plain.page, `${name}-no-script`);
    await plain.page.close();
  }
} finally {
  await browser.close();
}
console.log(`${pages.length} pages, ${checks} checks passed`);
