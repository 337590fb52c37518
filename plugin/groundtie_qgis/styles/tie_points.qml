<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>
<qgis version="3.22.0" styleCategories="Symbology|MapTips">
  <!-- A line runs from a point's place in the input image to its place on the reference, where the
       mark stands: a dot for points of the fit, a diamond for check points. Colour: residual. -->
  <renderer-v2 type="RuleRenderer" symbollevels="0" enableorderby="0" forceraster="0">
    <rules key="root">
      <rule key="fit" label="Point of the fit" filter="&quot;state&quot; = 'used' AND &quot;role&quot; = 'fit'">
        <rule key="fit1" symbol="0" label="residual up to 1 px" filter="&quot;residual_px&quot; &lt;= 1"/>
        <rule key="fit2" symbol="1" label="1 to 2 px" filter="&quot;residual_px&quot; &gt; 1 AND &quot;residual_px&quot; &lt;= 2"/>
        <rule key="fit3" symbol="2" label="above 2 px" filter="ELSE"/>
      </rule>
      <rule key="check" label="Check point, held out" filter="&quot;state&quot; = 'used' AND &quot;role&quot; = 'check'">
        <rule key="check1" symbol="3" label="residual up to 1 px" filter="&quot;residual_px&quot; &lt;= 1"/>
        <rule key="check2" symbol="4" label="1 to 2 px" filter="&quot;residual_px&quot; &gt; 1 AND &quot;residual_px&quot; &lt;= 2"/>
        <rule key="check3" symbol="5" label="above 2 px" filter="ELSE"/>
      </rule>
      <rule key="rejected" symbol="6" label="Rejected" filter="&quot;state&quot; &lt;&gt; 'used'"/>
    </rules>
    <symbols>
      <symbol name="0" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
        <layer class="SimpleLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="line_color" type="QString" value="26,150,65,255"/>
            <Option name="line_width" type="QString" value="0.4"/>
            <Option name="line_width_unit" type="QString" value="MM"/>
            <Option name="capstyle" type="QString" value="round"/>
          </Option>
        </layer>
        <layer class="MarkerLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="placement" type="QString" value="lastvertex"/>
            <Option name="rotate" type="QString" value="0"/>
          </Option>
          <symbol name="@0@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
            <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
              <Option type="Map">
                <Option name="name" type="QString" value="circle"/>
                <Option name="color" type="QString" value="26,150,65,255"/>
                <Option name="size" type="QString" value="2"/>
                <Option name="size_unit" type="QString" value="MM"/>
                <Option name="outline_color" type="QString" value="30,30,30,255"/>
                <Option name="outline_width" type="QString" value="0.2"/>
              </Option>
            </layer>
          </symbol>
        </layer>
      </symbol>
      <symbol name="1" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
        <layer class="SimpleLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="line_color" type="QString" value="253,174,42,255"/>
            <Option name="line_width" type="QString" value="0.6"/>
            <Option name="line_width_unit" type="QString" value="MM"/>
            <Option name="capstyle" type="QString" value="round"/>
          </Option>
        </layer>
        <layer class="MarkerLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="placement" type="QString" value="lastvertex"/>
            <Option name="rotate" type="QString" value="0"/>
          </Option>
          <symbol name="@1@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
            <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
              <Option type="Map">
                <Option name="name" type="QString" value="circle"/>
                <Option name="color" type="QString" value="253,174,42,255"/>
                <Option name="size" type="QString" value="2"/>
                <Option name="size_unit" type="QString" value="MM"/>
                <Option name="outline_color" type="QString" value="30,30,30,255"/>
                <Option name="outline_width" type="QString" value="0.2"/>
              </Option>
            </layer>
          </symbol>
        </layer>
      </symbol>
      <symbol name="2" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
        <layer class="SimpleLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="line_color" type="QString" value="215,25,28,255"/>
            <Option name="line_width" type="QString" value="0.8"/>
            <Option name="line_width_unit" type="QString" value="MM"/>
            <Option name="capstyle" type="QString" value="round"/>
          </Option>
        </layer>
        <layer class="MarkerLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="placement" type="QString" value="lastvertex"/>
            <Option name="rotate" type="QString" value="0"/>
          </Option>
          <symbol name="@2@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
            <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
              <Option type="Map">
                <Option name="name" type="QString" value="circle"/>
                <Option name="color" type="QString" value="215,25,28,255"/>
                <Option name="size" type="QString" value="2"/>
                <Option name="size_unit" type="QString" value="MM"/>
                <Option name="outline_color" type="QString" value="30,30,30,255"/>
                <Option name="outline_width" type="QString" value="0.2"/>
              </Option>
            </layer>
          </symbol>
        </layer>
      </symbol>
      <symbol name="3" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
        <layer class="SimpleLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="line_color" type="QString" value="26,150,65,255"/>
            <Option name="line_width" type="QString" value="0.4"/>
            <Option name="line_width_unit" type="QString" value="MM"/>
            <Option name="capstyle" type="QString" value="round"/>
          </Option>
        </layer>
        <layer class="MarkerLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="placement" type="QString" value="lastvertex"/>
            <Option name="rotate" type="QString" value="0"/>
          </Option>
          <symbol name="@3@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
            <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
              <Option type="Map">
                <Option name="name" type="QString" value="diamond"/>
                <Option name="color" type="QString" value="26,150,65,255"/>
                <Option name="size" type="QString" value="2.8"/>
                <Option name="size_unit" type="QString" value="MM"/>
                <Option name="outline_color" type="QString" value="30,30,30,255"/>
                <Option name="outline_width" type="QString" value="0.2"/>
              </Option>
            </layer>
          </symbol>
        </layer>
      </symbol>
      <symbol name="4" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
        <layer class="SimpleLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="line_color" type="QString" value="253,174,42,255"/>
            <Option name="line_width" type="QString" value="0.6"/>
            <Option name="line_width_unit" type="QString" value="MM"/>
            <Option name="capstyle" type="QString" value="round"/>
          </Option>
        </layer>
        <layer class="MarkerLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="placement" type="QString" value="lastvertex"/>
            <Option name="rotate" type="QString" value="0"/>
          </Option>
          <symbol name="@4@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
            <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
              <Option type="Map">
                <Option name="name" type="QString" value="diamond"/>
                <Option name="color" type="QString" value="253,174,42,255"/>
                <Option name="size" type="QString" value="2.8"/>
                <Option name="size_unit" type="QString" value="MM"/>
                <Option name="outline_color" type="QString" value="30,30,30,255"/>
                <Option name="outline_width" type="QString" value="0.2"/>
              </Option>
            </layer>
          </symbol>
        </layer>
      </symbol>
      <symbol name="5" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
        <layer class="SimpleLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="line_color" type="QString" value="215,25,28,255"/>
            <Option name="line_width" type="QString" value="0.8"/>
            <Option name="line_width_unit" type="QString" value="MM"/>
            <Option name="capstyle" type="QString" value="round"/>
          </Option>
        </layer>
        <layer class="MarkerLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="placement" type="QString" value="lastvertex"/>
            <Option name="rotate" type="QString" value="0"/>
          </Option>
          <symbol name="@5@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
            <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
              <Option type="Map">
                <Option name="name" type="QString" value="diamond"/>
                <Option name="color" type="QString" value="215,25,28,255"/>
                <Option name="size" type="QString" value="2.8"/>
                <Option name="size_unit" type="QString" value="MM"/>
                <Option name="outline_color" type="QString" value="30,30,30,255"/>
                <Option name="outline_width" type="QString" value="0.2"/>
              </Option>
            </layer>
          </symbol>
        </layer>
      </symbol>
      <symbol name="6" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
        <layer class="SimpleLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="line_color" type="QString" value="140,140,140,255"/>
            <Option name="line_width" type="QString" value="0.26"/>
            <Option name="line_width_unit" type="QString" value="MM"/>
            <Option name="capstyle" type="QString" value="round"/>
          </Option>
        </layer>
        <layer class="MarkerLine" enabled="1" locked="0" pass="0">
          <Option type="Map">
            <Option name="placement" type="QString" value="lastvertex"/>
            <Option name="rotate" type="QString" value="0"/>
          </Option>
          <symbol name="@6@1" type="marker" alpha="1" clip_to_extent="1" force_rhr="0">
            <layer class="SimpleMarker" enabled="1" locked="0" pass="0">
              <Option type="Map">
                <Option name="name" type="QString" value="cross2"/>
                <Option name="color" type="QString" value="140,140,140,255"/>
                <Option name="size" type="QString" value="1.8"/>
                <Option name="size_unit" type="QString" value="MM"/>
                <Option name="outline_color" type="QString" value="140,140,140,255"/>
                <Option name="outline_width" type="QString" value="0.2"/>
              </Option>
            </layer>
          </symbol>
        </layer>
      </symbol>
    </symbols>
  </renderer-v2>
  <mapTip>&lt;b>[% "role" %] point&lt;/b>: [% "state" %]&lt;br>residual [% format_number("residual_px", 2) %] px, score [% format_number("score", 1) %]</mapTip>
</qgis>
